"""Configuration of all tests: markers, missing libraries, and parallel runs of several files.

Nothing here needs Blender: `tests/motion` runs with NumPy and pytest alone. Fixtures for tests in Blender are in
`tests/in_blender.py`. If more than one test file is run, they run in parallel, one process per processor; see
`pytest_cmdline_main`.
"""

import functools
import os
import re
import signal
import unittest
from importlib.util import find_spec
from pathlib import Path

import pytest

from tests.recordings import RECORDINGS

pytest_plugins = ["tests.in_blender"] if find_spec("bpy") else []

ROOT = Path(__file__).resolve().parents[1]
os.environ["PYTHONPATH"] = os.pathsep.join(str(ROOT / folder) for folder in ("", "addon", "scripts"))
"""Lets processes started by tests import the same modules as the tests: pytest extends only its own path."""

EVERY_TEST, THOROUGH, QUICK = "RIGID_MOTION_EVERY_TEST", "RIGID_MOTION_THOROUGH", "RIGID_MOTION_QUICK"

WORKERS = 8
"""The largest number of workers: each is a Blender of half a gigabyte, which first collects all tests."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "LP_NUM_THREADS")
"""Variables for the number of threads of NumPy, and of OpenGL in software."""

BLENDERS_OWN = ("OCIO", "SYCL_UR_USE_LEVEL_ZERO_V2")
"""Variables that Blender 5.2 sets in its process, bypassing `os.environ`; another Blender complains about them."""

OWN_PACKAGES = {"assets", "examples", "research", "rigid_motion", "rigid_motion_batch", "tests"}
"""The project's own packages: a missing module of theirs is an error, not a missing library."""

IN_BLENDER = {"empty_file", "human", "extension_zip", "models"}
"""Fixtures that need Blender's module."""

NEEDS_BLENDER = re.compile(
    r"""^(import|from) (bpy|mathutils)|^\w+ = pytest\.importorskip\("bpy|^pytestmark = \[?\s*pytest\.mark\.blender""",
    re.MULTILINE,
)
"""A line that marks a test file, or the `conftest.py` of a folder, as needing Blender's module throughout."""

LOST = pytest.StashKey[bool]()
"""Whether a worker ended too early."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="run the first test of each file, with few of many cases")


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Run tests in parallel workers if more than one file is to run.

    A single file runs in this process, where it starts sooner. So do tests that are watched or debugged while they run.
    `-n` sets the number of workers in any case; `-n 0` means none.
    """
    option = config.option
    at_liberty = getattr(option, "numprocesses", 0) is None and not hasattr(config, "workerinput")
    watched = option.usepdb or option.trace or option.capture == "no"
    if at_liberty and not watched and _has_several_files(config):
        option.numprocesses = "auto"
        # Each worker starts with neighbouring tests, which share fixtures of a module, and helps others when done.
        option.dist = "worksteal" if option.dist == "no" else option.dist


def _has_several_files(config: pytest.Config) -> bool:
    files = {config.invocation_params.dir / argument.split("::")[0] for argument in config.args}
    return len(files) > 1 or any(file.is_dir() for file in files)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    from rigid_motion_batch.pipeline.executors import processors

    return min(processors(), WORKERS)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes(specs: list) -> None:
    """Start workers in an environment without Blender's own variables, each with its share of the processors."""
    for name in BLENDERS_OWN:
        if name not in os.environ:
            os.unsetenv(name)
    from rigid_motion_batch.pipeline.executors import processors

    for name in THREADS:
        os.environ.setdefault(name, str(max(1, processors() // len(specs))))


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object, error: object | None) -> None:
    """Record a worker that crashed between two tests: no test fails from that, so the crash would go unnoticed."""
    if error:
        node.config.stash[LOST] = True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    if config.stash.get(LOST, False):
        terminalreporter.write_line("A worker ended before its time, so this run has failed.", red=True)


def pytest_configure(config: pytest.Config) -> None:
    """Restore Ctrl-C, which shells let background processes and their children ignore."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.option.quick:
        os.environ[QUICK] = "1"


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.stash.get(LOST, False):
        session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector):
    """Skip a test file that needs a library that is not installed, unless every test has to run."""
    report = yield
    error = report.call.excinfo.value.__cause__ if report.failed else None
    if (
        isinstance(error, ModuleNotFoundError)
        and error.name.split(".")[0] not in OWN_PACKAGES
        and not os.environ.get(EVERY_TEST)
    ):
        report.outcome = "skipped"
        report.longrepr = (str(collector.path), 0, f"needs {error.name}")
    return report


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Ignore files that need Blender if tests without Blender are selected, and the other way round."""
    expression = config.option.markexpr
    if "not blender" in expression:
        return needs_blender(collection_path) or None
    is_file = collection_path.is_file() and collection_path.name.startswith("test_")
    return (expression.startswith("blender and") and is_file and not may_need_blender(collection_path)) or None


def may_need_blender(path: Path) -> bool:
    """Return whether any test of a file may need Blender's module: the whole file, or a test with a mark or fixture."""
    asks = re.compile("|".join(("mark.blender", *IN_BLENDER)))
    return needs_blender(path) or bool(asks.search(path.read_text(encoding="utf-8")))


@functools.cache
def needs_blender(path: Path) -> bool:
    """Return whether a test file needs Blender's module, or a folder, by its `conftest.py`."""
    file = path / "conftest.py" if path.is_dir() else path
    says = file.suffix == ".py" and file.is_file() and NEEDS_BLENDER.search(file.read_text(encoding="utf-8"))
    return bool(says) or (path != ROOT and ROOT in path.parents and needs_blender(path.parent))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark tests that need Blender, and tests that open its windows; deselect slow ones.

    Slow tests run if every test has to run, in thorough runs, if `-m` selects them, and if their file is run alone. A
    quick run takes the first test of each file that is marked neither slow nor once.
    """
    for item in items:
        if needs_blender(item.path) or IN_BLENDER & {*item.fixturenames}:
            item.add_marker("blender")
        if (ROOT / "tests" / "gui") in item.path.parents:
            item.add_marker("gui")
    asked_for = os.environ.get(EVERY_TEST) or os.environ.get(THOROUGH) or "slow" in config.option.markexpr
    left_out = {"slow"} if not asked_for and _has_several_files(config) else set()
    if config.option.quick:
        left_out = {"slow", "once"}
    kept = [item for item in items if not any(map(item.get_closest_marker, left_out))]
    if config.option.quick:
        # Tests of random edits take long even with few examples.
        kept = [item for item in kept if not (item.cls and issubclass(item.cls, unittest.TestCase))]
        kept = [*{item.path: item for item in reversed(kept)}.values()][::-1]
    config.hook.pytest_deselected(items=[*{*items} - {*kept}])
    items[:] = kept


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("recordings") and not RECORDINGS.is_dir():
        pytest.skip("the recordings are not beside the checkout")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    """Turn skipped tests into failures if every test has to run, as in continuous integration.

    Tests that need recordings are exempt: a checkout need not have the recordings next to it.
    """
    report = yield
    excused = hasattr(report, "wasxfail") or item.get_closest_marker("recordings")
    if report.skipped and not excused and os.environ.get(EVERY_TEST):
        report.outcome = "failed"
        report.longrepr = f"skipped, which {EVERY_TEST} forbids: {report.longrepr}"
    return report
