"""Supervisor: distributes inputs to worker processes, ends a worker that takes too long, and stores findings."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any, Final

from fuzz_files.judgement import FINDING
from fuzz_files.worker import Task, run_worker

START_S: Final = 120.0
"""Longest time until a worker has imported all readers and made the valid files of a target."""

WAITING_FACTOR: Final = 6.0
"""Ratio of the longest time of one input to its longest processor time."""

_FAST_FOLDER: Final = Path("/dev/shm")

Store = Callable[[Task, int, str], None]
"""Called with the task, the number of the input and the description of each finding."""


@dataclass
class Tally:
    """Number of inputs by target and outcome."""

    counts: dict[str, Counter[str]] = field(default_factory=dict)

    def add(self, target: str, counts: Counter[str]) -> None:
        """Add the outcomes of some inputs of a target."""
        self.counts.setdefault(target, Counter()).update(counts)

    def total(self) -> Counter[str]:
        """Return the outcomes of all targets."""
        return sum(self.counts.values(), Counter())


class _Worker:
    """A worker process and its present task."""

    def __init__(self) -> None:
        """Start the process with a temporary folder of its own."""
        context = multiprocessing.get_context("spawn")
        parent = str(_FAST_FOLDER) if _FAST_FOLDER.is_dir() else None
        self.folder = tempfile.mkdtemp(prefix="taxel-fuzz-", dir=parent)
        self.number: Any = context.Value("q", -1, lock=False)
        self.connection, own = context.Pipe()
        self.process = context.Process(target=run_worker, args=(own, self.number, self.folder), daemon=True)
        self.process.start()
        own.close()
        self.task: Task | None = None
        self._seen = -1
        self._since_s = time.monotonic()
        self._since_cpu_s = 0.0

    def give(self, task: Task | None) -> None:
        """Send a task; None ends the process."""
        self.task = task
        self._since_s = time.monotonic()
        self.connection.send(task)

    def is_late(self, limit_s: float) -> bool:
        """Return whether the worker has spent more than `limit_s` on one input.

        The limit holds for the processor time, so a loaded machine causes no finding. A worker that waits uses no
        processor time; it is late after a wall-clock time of `WAITING_FACTOR` times the limit. While the worker reads
        no input, for example during its start, the limit is `START_S` of processor time.
        """
        present = self.number.value
        now, cpu_s = time.monotonic(), _read_cpu_seconds(self.process.pid)
        if present != self._seen:
            self._seen, self._since_s, self._since_cpu_s = present, now, cpu_s
        if present < 0:
            return cpu_s - self._since_cpu_s > START_S
        return cpu_s - self._since_cpu_s > limit_s or now - self._since_s > WAITING_FACTOR * limit_s

    def end(self) -> None:
        """End the process and remove its folder."""
        self.process.kill()
        self.process.join()
        self.connection.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def _read_cpu_seconds(process: int | None) -> float:
    """Return the processor time of a process in seconds; 0 for one that has ended."""
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")  # utime and stime, clock ticks


def run_tasks(tasks: list[Task], jobs: int, limit_s: float, store: Store, show: Callable[[Tally], None]) -> Tally:
    """Carry out all tasks in worker processes and return the outcomes.

    limit_s: longest processor time of one input. store: called for each finding. show: called about once per second.
    """
    waiting, tally, shown_s = deque(tasks), Tally(), time.monotonic()
    workers = [_Worker() for _ in range(min(jobs, len(tasks)))]
    try:
        for worker in workers:
            worker.give(waiting.popleft())
        while any(worker.task for worker in workers):
            wait([worker.connection for worker in workers if worker.task], timeout=0.2)
            for index, worker in enumerate(workers):
                workers[index] = _attend(worker, waiting, tally, limit_s, store)
            if time.monotonic() - shown_s > 1.0:
                shown_s = time.monotonic()
                show(tally)
    finally:
        for worker in workers:
            worker.end()
    return tally


def _attend(worker: _Worker, waiting: deque[Task], tally: Tally, limit_s: float, store: Store) -> _Worker:
    """Take the result of a worker and give it the next task; replace a worker that has ended or is late.

    waiting: tasks that no worker has received yet. tally: outcomes, updated. limit_s: longest processor time of one
    input. store: called for each finding. Returns the worker, or its replacement.
    """
    task = worker.task
    if task is None:
        return worker
    if worker.connection.poll():
        try:
            counts, findings = worker.connection.recv()
        except (EOFError, ConnectionError):
            return _replace(worker, task, "crash: the process has ended", waiting, tally, store)
        tally.add(task.target, counts)
        for number, text in findings:
            store(task, number, text)
        if waiting:
            worker.give(waiting.popleft())
        else:
            worker.task = None
        return worker
    if not worker.process.is_alive():
        return _replace(worker, task, "crash: the process has ended", waiting, tally, store)
    if worker.is_late(limit_s):
        return _replace(worker, task, f"hang: more than {limit_s:g} s", waiting, tally, store)
    return worker


def _replace(worker: _Worker, task: Task, text: str, waiting: deque[Task], tally: Tally, store: Store) -> _Worker:
    """Replace a worker whose process has ended or is late, and return the new worker, which has the next task.

    Stores a finding of the worker's present input; the next task begins after this input. Exception: after SIGKILL,
    nothing is stored, and the new worker repeats the whole task once. text: description of the finding.
    """
    number = worker.number.value
    worker.process.join(0.5)
    code = worker.process.exitcode
    worker.end()
    other = _Worker()
    if code == -signal.SIGKILL and not task.is_repeated:
        # The kernel ends a process if other programs exhaust the memory; only an input that fails again is a finding.
        other.give(replace(task, is_repeated=True))
        return other
    store(task, number, text if code is None else f"{text} with status {code}")
    tally.add(task.target, Counter({FINDING: 1}))
    behind = max(number, task.first) + 1
    waiting.appendleft(Task(task.target, task.seed, behind, task.first + task.count - behind))
    other.give(waiting.popleft())
    return other
