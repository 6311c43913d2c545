"""How all tests run: markers, libraries that are not installed, and several files side by side.

Nothing here needs Blender: `tests/motion` runs with NumPy and pytest alone. What tests in Blender share is in
`tests/in_blender.py`. More than one file of tests runs side by side, in a process for each processor; see
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
"""Processes that tests start find what the tests find; pytest has put these on the path of its own alone."""

EVERY_TEST, THOROUGH, QUICK = "RIGID_MOTION_EVERY_TEST", "RIGID_MOTION_THOROUGH", "RIGID_MOTION_QUICK"

WORKERS = 8
"""The most that are started: each is a Blender of half a gigabyte, which first collects all tests."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "LP_NUM_THREADS")
"""How many NumPy takes, and OpenGL in software."""

BLENDERS_OWN = ("OCIO", "SYCL_UR_USE_LEVEL_ZERO_V2")
"""What Blender 5.2 puts into the environment of its process, past `os.environ`; another Blender complains of it."""

OURS = {"assets", "examples", "research", "rigid_motion", "rigid_motion_batch", "tests"}
"""A part of these that is not there is a fault, and no missing library."""

IN_BLENDER = {"empty_file", "human", "extension_zip", "models"}
"""Fixtures that need Blender's module."""

NEEDS_BLENDER = re.compile(
    r"""^(import|from) (bpy|mathutils)|^\w+ = pytest\.importorskip\("bpy|^pytestmark = \[?\s*pytest\.mark\.blender""",
    re.MULTILINE,
)
"""How a file of tests, or the `conftest.py` of a folder, says that all of it needs Blender's module."""

LOST = pytest.StashKey[bool]()
"""Whether a worker ended before its time."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="run the first test of each file, with few of many cases")


@pytest.hookimpl(tryfirst=True)
def pytest_cmdline_main(config: pytest.Config) -> None:
    """Have more than one file of tests run by workers side by side.

    One file runs in this process, where it begins sooner, and so does what is to be seen or stopped while it runs. `-n`
    says how many workers it shall be in any case, `-n 0` that there shall be none.
    """
    option = config.option
    at_liberty = getattr(option, "numprocesses", 0) is None and not hasattr(config, "workerinput")
    watched = option.usepdb or option.trace or option.capture == "no"
    if at_liberty and not watched and _has_several_files(config):
        option.numprocesses = "auto"
        # A worker begins with neighbouring tests, which share what a module sets up, and helps others when it is done.
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
    """Start workers in an environment as if no Blender was here, each with its share of the processors."""
    for name in BLENDERS_OWN:
        if name not in os.environ:
            os.unsetenv(name)
    from rigid_motion_batch.pipeline.executors import processors

    for name in THREADS:
        os.environ.setdefault(name, str(max(1, processors() // len(specs))))


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: object, error: object | None) -> None:
    """A worker that crashed between two tests has lost none, and would be missed by nobody."""
    if error:
        node.config.stash[LOST] = True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    if config.stash.get(LOST, False):
        terminalreporter.write_line("A worker ended before its time, so this run has failed.", red=True)


def pytest_configure(config: pytest.Config) -> None:
    """Begin: a shell lets what it runs in the background ignore Ctrl-C, and all that is started from there."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if config.option.quick:
        os.environ[QUICK] = "1"


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.config.stash.get(LOST, False):
        session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector):
    """Skip a file of tests that needs a library which is not installed, unless every test has to run."""
    report = yield
    error = report.call.excinfo.value.__cause__ if report.failed else None
    if (
        isinstance(error, ModuleNotFoundError)
        and error.name.split(".")[0] not in OURS
        and not os.environ.get(EVERY_TEST)
    ):
        report.outcome = "skipped"
        report.longrepr = (str(collector.path), 0, f"needs {error.name}")
    return report


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave files alone that need Blender where those are asked for that need none, and the other way round."""
    expression = config.option.markexpr
    if "not blender" in expression:
        return needs_blender(collection_path) or None
    is_file = collection_path.is_file() and collection_path.name.startswith("test_")
    return (expression.startswith("blender and") and is_file and not may_need_blender(collection_path)) or None


def may_need_blender(path: Path) -> bool:
    """Return whether any test of a file may need Blender's module: all of it, or one by a mark or a fixture."""
    asks = re.compile("|".join(("mark.blender", *IN_BLENDER)))
    return needs_blender(path) or bool(asks.search(path.read_text(encoding="utf-8")))


@functools.cache
def needs_blender(path: Path) -> bool:
    """Return whether a file of tests needs Blender's module, or a folder, whose `conftest.py` says it for all in it."""
    file = path / "conftest.py" if path.is_dir() else path
    says = file.suffix == ".py" and file.is_file() and NEEDS_BLENDER.search(file.read_text(encoding="utf-8"))
    return bool(says) or (path != ROOT and ROOT in path.parents and needs_blender(path.parent))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what needs Blender, and what opens windows of it; leave out what is slow.

    Slow tests run where every test has to, in thorough runs, where `-m` chooses, and where their file is named alone.
    A quick run takes the first test of each file that is not slow, nor is once enough.
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
        # Random edits take their time however few they are.
        kept = [item for item in kept if not (item.cls and issubclass(item.cls, unittest.TestCase))]
        kept = [*{item.path: item for item in reversed(kept)}.values()][::-1]
    config.hook.pytest_deselected(items=[*{*items} - {*kept}])
    items[:] = kept


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("recordings") and not RECORDINGS.is_dir():
        pytest.skip("the recordings are not beside the checkout")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    """Where every test has to run, as in continuous integration, one that was skipped has failed.

    But for those that need recordings, which a checkout need not have beside it.
    """
    report = yield
    excused = hasattr(report, "wasxfail") or item.get_closest_marker("recordings")
    if report.skipped and not excused and os.environ.get(EVERY_TEST):
        report.outcome = "failed"
        report.longrepr = f"skipped, which {EVERY_TEST} forbids: {report.longrepr}"
    return report
