"""Fault campaign of one writer: every fault at every call, and the judgement of each run."""

import os
import random
import shutil
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

from crash_case import Acknowledge, Case
from crash_injection import FAULTS, Injector, Mode, RunResult

_REMOVALS = frozenset({"unlink", "unlinkat", "rmdir"})
"""Calls that remove a name; if one of them fails, the name remains."""

PREVIOUS = ".previous"


@dataclass
class Outcome:
    """Result of the campaign of one writer.

    Attributes:
        name: of the writer. guarantee: see `Case`. calls: counted calls of a run without fault.
        runs: number of runs with a fault. ends: number of runs by end: "old", "part" (some records) or "new".
        problems: one line for each broken guarantee, with the options that repeat it.
    """

    name: str
    guarantee: str
    calls: int = 0
    runs: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    problems: list[str] = field(default_factory=list)


class Campaign:
    """Runs of one writer with faults, each in a new copy of a prepared folder."""

    def __init__(self, case: Case, injector: Injector, folder: Path, source: Path) -> None:
        """Write the old output, which every run then replaces or extends.

        folder: empty folder for all runs. source: capture that conversions read.
        """
        self._case, self._injector, self._source = case, injector, source
        self._template, self._work = folder / "old", folder / "work"
        self._template.mkdir()
        case.prepare(self._template, source)
        self.outcome = Outcome(case.name, case.guarantee)

    def measure(self) -> list[str]:
        """Run the writer without a fault and return the names of the calls that change a file, in order.

        Also stores the permitted states of the output, which `run` needs: the old output, and the output after each
        record.
        """
        self._renew()
        self._states = [repr(self._case.read(self._work))]
        result = self._execute(0, Mode.COUNT)
        if result.status != 0:
            self._report(0, Mode.COUNT, f"exit status {result.status}: {result.errors}")
        self._states += result.acknowledged
        self._calls = result.calls
        self.outcome.calls = len(result.calls)
        return result.calls

    def run(self, faults: Iterable[tuple[int, Mode]]) -> None:
        """Run the writer once for each fault (number of the call from 1, mode), judge the result, and run it again
        without a fault.
        """
        for call, mode in faults:
            self._renew()
            result = self._execute(call, mode)
            self.outcome.runs += 1
            self._judge(call, mode, result)
            self._recover(call, mode)

    def _renew(self) -> None:
        """Replace the working folder with a new copy of the prepared folder."""
        shutil.rmtree(self._work, ignore_errors=True)
        shutil.copytree(self._template, self._work)

    def _execute(self, call: int, mode: Mode) -> RunResult:
        """Run the writer in a child process with a fault at the call `call`; 0 for no fault."""
        case, work = self._case, self._work

        def write(acknowledge: Acknowledge) -> None:
            case.run(work, self._source, acknowledge)

        return self._injector.run(write, work, call, mode, lambda: repr(case.read(work)))

    def _judge(self, call: int, mode: Mode, result: RunResult) -> None:
        """Compare the result of a run with the writer's guarantee, and store one problem for each difference."""
        for problem in (*_judge_end(mode, result), *self._judge_output(call, mode, result)):
            self._report(call, mode, problem)

    def _judge_output(self, call: int, mode: Mode, result: RunResult) -> Iterator[str]:
        """Yield one line for each broken guarantee of the files that a run has left, and count the kind of output."""
        try:
            state = repr(self._case.read(self._work))
        except Exception as error:
            yield f"unreadable: {type(error).__name__}: {error}"
            return
        last = len(self._states) - 1
        if state not in self._states:
            yield f"neither the old output nor complete records: {state[:200]}"
            return
        # Equal states, such as those of a writer with one result, count as the latest one.
        position = last - self._states[::-1].index(state)
        self.outcome.ends["old" if position == 0 else "new" if position == last else "part"] += 1
        if position < len(result.acknowledged):
            yield f"{len(result.acknowledged)} records were complete, {position} are readable"
        if result.status == 0 and position != last:
            yield f"exit status 0, but {position} of {last} records"
        if self._case.guarantee == "live" and 0 < position < last:
            yield from self._judge_previous()
        # Only a process that lives on, and whose calls that remove a file succeed, can remove its temporary files.
        if not mode.is_kill and mode is not Mode.BROKEN and self._calls[call - 1] not in _REMOVALS:
            yield from self._judge_names(result.status != 0)

    def _judge_previous(self) -> Iterator[str]:
        """Yield a problem if an incomplete recording has destroyed the recording that it replaces."""
        name = self._case.names[0]
        previous = self._work / f".{name}{PREVIOUS}"
        if not previous.exists() or previous.read_bytes() != (self._template / name).read_bytes():
            yield "the replaced recording is lost"

    def _judge_names(self, has_failed: bool) -> Iterator[str]:
        """Yield a problem for each temporary file that a run has left although it could clean up.

        has_failed: the run has failed, so the replaced recording may remain.
        """
        for path in sorted(self._work.rglob(".*")):
            if not (has_failed and self._case.guarantee == "live" and path.name.endswith(PREVIOUS)):
                yield f"left over: {path.name}"

    def _recover(self, call: int, mode: Mode) -> None:
        """Run the writer again without a fault: it must succeed and leave no temporary file."""
        result = self._execute(0, Mode.COUNT)
        if result.status != 0:
            self._report(call, mode, f"the next run fails: {result.errors.strip()}")
            return
        state = repr(self._case.read(self._work))
        if self._case.guarantee == "live" and state != self._states[-1]:
            self._report(call, mode, "the next run gives another output")
        # The journal of an SQLite database is no temporary file of the writer.
        names = {name for name in os.listdir(self._work) if not name.endswith("-journal")}
        if names != set(self._case.names):
            self._report(call, mode, f"the next run leaves {sorted(names - set(self._case.names))}")

    def _report(self, call: int, mode: Mode, problem: str) -> None:
        """Store a problem with the command-line options that repeat it."""
        name = self._calls[call - 1] if 0 < call <= len(self._calls) else "no fault"
        text = f'{problem} [--case "{self._case.name}" --call {call} --mode {mode.name}; {name}]'
        self.outcome.problems.append(" ".join(text.split()))

    _calls: list[str] = []  # noqa: RUF012 - replaced by `measure`
    _states: list[str] = []  # noqa: RUF012


def _judge_end(mode: Mode, result: RunResult) -> Iterator[str]:
    """Yield the problems with the end of the process itself: a hang, a crash, a wrong exit status or wrong error
    output.
    """
    if result.is_hung:
        yield "hang"
    elif result.status < 0 and not (mode.is_kill and result.status == -9):  # -9: SIGKILL of the fault
        yield f"crash: signal {-result.status}: {result.errors[-200:]}"
    elif result.status > 1 or "Traceback" in result.errors or "Exception ignored" in result.errors:
        yield f"exit status {result.status}: {result.errors[-300:]}"
    elif result.status == 1 and result.errors.count("\n") != 1:
        yield f"expected one error line, found: {result.errors[-300:]}"
    elif result.status == 0 and result.errors:
        yield f"exit status 0 with an error: {result.errors[-300:]}"


def list_faults(calls: int, sample: int | None, seed: str) -> list[tuple[int, Mode]]:
    """Return all pairs (number of the call, mode), or `sample` random pairs; the same seed gives the same pairs."""
    pairs: list[tuple[int, Mode]] = list(product(range(1, calls + 1), FAULTS))
    if sample is None or sample >= len(pairs):
        return pairs
    return random.Random(seed).sample(pairs, sample)
