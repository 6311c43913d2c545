"""What a step uses, found in the text of the modules: beside what it really imports and reads."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion_batch.comparison import steps
from rigid_motion_batch.places import NAMED
from rigid_motion_batch.workplan.module_text import read_module
from rigid_motion_batch.workplan.sources import SourceReader
from tests.scripts.comparing import ROOT

STEPS = ("read", "measure", "count_keys", "tabulate", "tabulate_keys", "build", "render", "encode")
REPORTS = ("report", "clip_page", "overview")


@pytest.fixture(scope="module")
def files() -> dict[str, frozenset[str]]:
    """Every step of a comparison, and the files that it uses."""
    reader = SourceReader()
    return {name: reader.sources_of(f"{steps.__name__}:{name}").files for name in (*STEPS, *REPORTS)}


WATCHED = """
import json, sys
from pathlib import Path
from importlib.util import source_from_cache
root, output, step, fields = Path(sys.argv[1]), sys.argv[2], sys.argv[3], json.loads(sys.argv[4])
opened = set()
def watch(event, arguments):
    if event == "open" and isinstance(arguments[0], str) and arguments[0].startswith(str(root)):
        opened.add(arguments[0])
sys.addaudithook(watch)
from rigid_motion_batch.places import name_of
from rigid_motion_batch.workplan.tasks import find_step
from rigid_motion_batch.workplan.performing import Made, Order, perform
done = perform(Order(**fields), lambda message: None)
assert isinstance(done, Made), done
loaded = {module.__file__ for module in sys.modules.values() if getattr(module, "__file__", None)}
named = {source_from_cache(path) if path.endswith(".pyc") else path for path in opened | loaded}
own = {name_of(Path(p)) for p in named if p.startswith(str(root) + "/") and not p.startswith(sys.prefix + "/")}
print(json.dumps(sorted(own - {None})))
"""


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, object]]:
    """A comparison with films, whose tasks can be done again: for every step the order of a task."""
    from rigid_motion_batch.cli import compare
    from rigid_motion_batch.workplan import Plan
    from rigid_motion_batch.workplan.running import order_for
    from tests.scripts.comparing import write_toss

    output = tmp_path_factory.mktemp("compared")
    clip = write_toss(output / "toss.csv", samples=20)
    asked = [str(clip), "--output", str(output / "out"), "--resolution", "64x36", "--fps", "6", "--jobs", "0"]
    asked += ["--decimate", "adaptive", "--budget", "5", "--modes", "lerp_slerp,best_of,dq_sclerp"]
    assert compare.main(asked) == 0
    plan = Plan.read(output / "out" / ".workplan" / "plan.json")

    class Folder:
        output = plan.folder

        @staticmethod
        def scratch() -> Path:
            return tmp_path_factory.mktemp("scratch")

    Folder.output = output / "out"
    tasks = {task.function.partition(":")[2]: task for task in plan.tasks.values()}
    return {name: order_for(task, {}, task.after, Folder).as_json() for name, task in tasks.items()}


@pytest.mark.parametrize("name", ["read", "measure", "count_keys", "tabulate", "tabulate_keys", "build", "report"])
def test_no_step_imports_or_opens_a_file_of_this_program_that_it_is_not_known_to_use(
    name: str, compared: dict[str, dict[str, object]], files: dict[str, frozenset[str]]
) -> None:
    order = json.dumps(compared[name])
    done = subprocess.run(
        [sys.executable, "-c", WATCHED, ROOT, compared[name]["output"], name, order],
        capture_output=True,
        text=True,
        cwd=ROOT,
        timeout=120,
        check=False,
    )
    assert done.stdout, done.stderr
    used = set(json.loads(done.stdout.splitlines()[-1]))
    plan = {file for file in used if file.startswith("rigid_motion_batch/workplan/")}
    own = {"rigid_motion_batch/comparison/steps.py", "rigid_motion_batch/progress.py"}
    assert used - plan - own - files[name] == set()
    assert files[name] & used


def test_no_film_depends_on_the_report_and_no_report_on_the_films(files: dict[str, frozenset[str]]) -> None:
    report = {file for file in files["report"] if "/report/" in file}
    assert {Path(file).suffix for file in report} == {".py", ".css", ".html", ".js"}
    assert [file for name in ("build", "render", "encode") for file in files[name] if "/report/" in file] == []
    assert [file for name in REPORTS for file in files[name] if "/stage/" in file] == []
    assert [file for name in ("measure", "count_keys") for file in files[name] if "/page/" in file] == []
    assert "assets/models.blend" in files["build"]


def test_of_its_own_module_a_step_depends_on_itself_and_what_it_refers_to() -> None:
    own = SourceReader().sources_of(f"{steps.__name__}:render").own
    assert "def render(" in own
    assert "def piece_of(" in own
    assert "def measure(" not in own


@pytest.mark.parametrize("name", ["nothing", "Clips_"])
def test_a_step_that_is_not_there_is_said(name: str) -> None:
    with pytest.raises(ValueError, match="no function of that name"):
        SourceReader().sources_of(f"{steps.__name__}:{name}")


TEXT = '''
"""Not imported: from hidden import this"""
from __future__ import annotations
import os.path
from typing import TYPE_CHECKING
from rigid_motion_batch.places import ASSETS
from .near import one, two
MODELS = ASSETS / "models.blend"
if TYPE_CHECKING:
    from never import Type
try:
    import perhaps
except ImportError:
    from .. import instead
PAGE = Path(__file__).parent / "near" / "page"
def later():
    from far.off import thing
    with open(Path(__file__).resolve().parents[1] / "data.txt"):
        match thing:
            case 1:
                import deep
'''


def test_imports_are_found_wherever_they_are_and_files_by_their_way_from_the_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(NAMED, "top", tmp_path)
    (tmp_path / "package" / "near" / "page").mkdir(parents=True)
    (tmp_path / "data.txt").touch()
    path = tmp_path / "package" / "module.py"
    path.write_text(TEXT)
    module = read_module(path, "top.package.module")
    at_once = {
        ("__future__", ("annotations",)),
        ("os.path", ()),
        ("typing", ("TYPE_CHECKING",)),
        ("rigid_motion_batch.places", ("ASSETS",)),
        ("top.package.near", ("one", "two")),
        ("perhaps", ()),
        ("top", ("instead",)),
    }
    assert set(module.at_once) == at_once
    assert set(module.imports) == at_once | {("far.off", ("thing",)), ("deep", ())}
    assert set(module.places) == {"assets/models.blend", "top/data.txt", "top/package/near/page"}


def test_what_was_found_is_kept_and_looked_for_again_where_it_is_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    kept = tmp_path / "sources.json"
    wanted = f"{steps.__name__}:render"
    first = SourceReader(kept)
    found = first.sources_of(wanted)
    first.keep()
    text = kept.read_text()
    for content in (text, text[: len(text) // 2], '{"rigid_motion/motion/poses.py": [1]}'):
        kept.write_text(content)
        assert SourceReader(kept).sources_of(wanted) == found
