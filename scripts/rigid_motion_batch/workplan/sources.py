"""What a step uses of this program: the modules that it can come to import, and the files that they name.

Found in the text of the modules, without running any: of the step's own module its function and what that refers to,
of the modules that these import everything. Modules that are imported where they are needed, within functions, are
found as well. The work plan itself is left out: how a task comes to be done makes no difference to what comes of it.

Reading hundreds of modules takes half a second, so what was found is kept beside Python's own compiled modules.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.files import write_text
from rigid_motion_batch.places import name_of, place_of

from .hashing import digest_of, file_digest, sources_below
from .module_text import Import, Module, own_text, packages_above, read_module
from .tasks import file_of

WORK_PLAN = __package__

DIGITS = 12
"""Of the digest of a file."""

KEPT = Path(__file__).with_name("__pycache__") / "sources.json"


@dataclass(frozen=True)
class Sources:
    """What a step uses."""

    own: str
    """The text of the function, and of what it refers to in its module."""

    files: frozenset[str]
    """The modules of this program that it imports, its own left out, and the files that they name; by their names in
    `places`."""

    packages: frozenset[str]
    """The packages from elsewhere that it imports, and the standard library's."""


class SourceReader:
    """Finds what steps use. Of modules that have not changed since it was last asked it knows.

    Parameters
    ----------
    kept : Path, optional
        Where it keeps what it knows of the modules; nowhere unless given.
    """

    def __init__(self, kept: Path | None = None) -> None:
        self._kept = kept
        self._known: dict[str, list[object]] = _read_kept(kept) if kept else {}
        self._modules: dict[str, Module] = {}
        self._digests: dict[str, str] = {}
        self._changed = False

    def sources_of(self, function: str) -> Sources:
        """What a step uses.

        Parameters
        ----------
        function : str
            As tasks name it, "package.module:function".

        Raises
        ------
        ValueError
            Where there is no such function.
        """
        name, _, wanted = function.partition(":")
        path = file_of(name)
        if path is None:
            raise ValueError(f"{function}: this program has no module {name}")
        own, imports = own_text(path, name, wanted)
        if not own:
            raise ValueError(f"{function}: {name} has no function of that name")
        files, packages = set(self._data_of(path)), set()
        waiting = [(one, True) for one in _modules_of(imports)] + [(one, False) for one in packages_above(name)]
        seen = {(name, True), (name, False)}
        while waiting:
            found = waiting.pop()
            if found in seen or found[0] == WORK_PLAN or found[0].startswith(f"{WORK_PLAN}."):
                continue
            seen.add(found)
            module, everything = found
            if place := file_of(module):
                files |= {name_of(place), *self._data_of(place)}
                facts = self._module(place, module)
                waiting += [(one, True) for one in _modules_of(facts.imports if everything else facts.at_once)]
                waiting += [(one, False) for one in packages_above(module)]
            else:
                packages.add(module.partition(".")[0])
        return Sources(own, frozenset(files), frozenset(packages))

    def versions_of(self, function: str) -> dict[str, str]:
        """Each file that a step uses, and its own text, to the digest of the content."""
        sources = self.sources_of(function)
        own = {function.partition(":")[2]: digest_of(sources.own)[:DIGITS]}
        return own | {file: self._digest(file) for file in sorted(sources.files)}

    def keep(self) -> None:
        """Keep what was found for the next time, if that can be."""
        if self._kept and self._changed and not sys.dont_write_bytecode:
            with suppress(OSError):
                write_text(self._kept, json.dumps(self._known))

    def _module(self, path: Path, name: str) -> Module:
        """What there is to know of a module."""
        file = name_of(path)
        if file not in self._modules:
            status = path.stat()
            state, known = [status.st_size, status.st_mtime_ns], self._known.get(file)
            try:
                if not known or known[:2] != state:
                    raise ValueError
                self._modules[file] = Module.from_json(known[2])
            except (ValueError, TypeError, LookupError):
                self._modules[file] = read_module(path, name)
                self._known[file] = [*state, self._modules[file].as_json()]
                self._changed = True
        return self._modules[file]

    def _data_of(self, path: Path) -> Iterator[str]:
        """The files that a module names, and all those of the folders."""
        name = name_of(path).removesuffix(".py").removesuffix("/__init__").replace("/", ".")
        for place in self._module(path, name).places:
            yield from map(name_of, sources_below(place_of(place)))

    def _digest(self, file: str) -> str:
        if file not in self._digests:
            self._digests[file] = file_digest(place_of(file))[:DIGITS]
        return self._digests[file]


def _modules_of(imports: Iterable[Import]) -> Iterator[str]:
    """The modules that imports name. What is taken from a package may be a module of it, or something in it."""
    for base, names in imports:
        inner = [module for name in names if file_of(module := f"{base}.{name}")]
        yield from inner
        if len(inner) < len(names) or not names:
            yield base


def _read_kept(path: Path) -> dict[str, list[object]]:
    try:
        known = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return {file: one for file, one in known.items() if isinstance(one, list)} if isinstance(known, dict) else {}
