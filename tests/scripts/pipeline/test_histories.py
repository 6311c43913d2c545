"""Random histories of an output folder: plans change, files are edited, deleted and damaged, and runs catch up."""

import shutil
from pathlib import Path
from tempfile import mkdtemp

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, rule

from rigid_motion_batch.pipeline.running import FAILED, SKIPPED
from rigid_motion_batch.pipeline.steps import OWN_FOLDER, RunError, Task
from tests.scripts.pipeline.plans import contents, joining, run_in, states, task
from tests.scripts.pipeline.steps import Fail, Join, Report, Write
from tests.thoroughness import tried

FAILS = "fails"
TEXTS = st.sampled_from(["1", "2", "3", FAILS])
NAMES = st.sampled_from(["a", "b", "both", "after", "report"])


class Histories(RuleBasedStateMachine):
    """Two tasks that may be equal or fail, one that joins both, one that joins that, and one that accepts gaps."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(mkdtemp())
        self.output, self.log = self.folder / "out", self.folder / "log"
        self.texts = {"a": "1", "b": "2"}
        self.kept: dict[str, str] = {}
        """The key of each existing result, and its text."""
        self.there: dict[str, str] = {}
        """The content of the file of each task."""
        self.placed: dict[str, str] = {}
        """The key of the result that a file was published from, unless the file was touched since."""
        self.own: dict[str, set[str]] = {name: set() for name in ("a", "b", "both", "after", "report")}
        """All texts that were ever published to the file of each task."""

    def teardown(self) -> None:
        shutil.rmtree(self.folder)

    def plan(self) -> list[Task]:
        log = str(self.log)
        a, b = (task(name, Fail() if text == FAILS else Write(text, log)) for name, text in self.texts.items())
        both = joining("both", a, b, log=log)
        return [a, b, both, joining("after", both, log=log), task("report", Report(log), a, b)]

    @rule(name=st.sampled_from("ab"), text=TEXTS, overwrite=st.booleans())
    def ask_for(self, name: str, text: str, overwrite: bool) -> None:
        self.texts[name] = text
        self.run(overwrite)

    @rule(name=NAMES, text=st.sampled_from(["edited", "1", "12"]), overwrite=st.booleans())
    def edit(self, name: str, text: str, overwrite: bool) -> None:
        self.output.mkdir(exist_ok=True)
        (self.output / f"{name}.txt").unlink(missing_ok=True)
        (self.output / f"{name}.txt").write_text(text)
        self.there[name] = text
        self.placed.pop(name, None)
        self.run(overwrite)

    @rule(name=NAMES)
    def delete(self, name: str) -> None:
        (self.output / f"{name}.txt").unlink(missing_ok=True)
        self.forget(name)
        self.run(overwrite=False)

    def forget(self, name: str) -> None:
        self.there.pop(name, None)
        self.placed.pop(name, None)

    @rule(number=st.integers(0, 9))
    def damage(self, number: int) -> None:
        if self.kept:
            key = sorted(self.kept)[number % len(self.kept)]
            (self.output / OWN_FOLDER / "results" / key / "out.txt").unlink()
            del self.kept[key]
        self.run(overwrite=True)

    def run(self, overwrite: bool) -> None:
        plan = self.plan()
        self.log.write_text("")
        left = [it.name for it in plan if not (it.key in self.kept and self.placed.get(it.name) == it.key)]
        foreign = [name for name in left if name in self.there and self.there[name] not in self.own[name]]
        done: list[str] = []
        if foreign and not overwrite:
            with pytest.raises(RunError, match=f"{foreign[0]}.txt was not written by this program, or edited since"):
                run_in(self.output, *plan)
        else:
            outcome = run_in(self.output, *plan, overwrite=overwrite)
            done, failed, skipped = self.simulate(plan)
            assert outcome.failures == dict.fromkeys(failed, "it cannot be made; make another")
            assert states(outcome).get(FAILED, 0) == len(failed)
            assert states(outcome).get(SKIPPED, 0) == skipped
        assert sorted(self.log.read_text().split()) == sorted(done)
        assert contents(self.output) == {f"{name}.txt": text for name, text in self.there.items()}

    def simulate(self, plan: list[Task]) -> tuple[list[str], set[str], int]:
        """Simulate a run, and return the expected log, the failed tasks, and the number of skipped tasks."""
        settled: dict[str, str | None] = {}
        done, failed, skipped = [], set(), 0
        for it in plan:
            before = [settled[key] for key in it.after]
            key: str | None = it.key_after(before)
            is_enough = any(before) if it.step.partial else None not in before
            if isinstance(it.step, Fail):
                failed.add(it.name)
                key = None
            elif key not in self.kept and not is_enough:
                skipped += 1
                key = None
            elif key not in self.kept:
                is_join = isinstance(it.step, Join)
                self.kept[key] = "".join(self.kept[one] for one in before if one) if is_join else it.step.text
                done.append("join" if is_join else it.step.text)
            settled[it.key] = key
            if key:
                self.there[it.name] = self.kept[key]
                self.own[it.name].add(self.kept[key])
                self.placed[it.name] = key
            elif self.there.get(it.name) in self.own[it.name]:
                self.forget(it.name)
        return done, failed, skipped


TestHistories = Histories.TestCase
TestHistories.settings = settings(deadline=None, max_examples=tried(40), stateful_step_count=15)
