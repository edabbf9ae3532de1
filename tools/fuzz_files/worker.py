"""Process that reads mutants under limits; a supervisor ends it when one input takes too long."""

from __future__ import annotations

import os
import resource
import signal
import sys
import tempfile
from collections import Counter
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

from fuzz_files.judgement import FINDING, MutantReader, Outcome
from fuzz_files.registry import list_targets

MEMORY_MAX: Final = 1 << 30
"""Largest additional memory of one input, bytes: the requirement for every reader."""

_MARGIN: Final = 1 << 29
"""Memory above the limit that the process may still allocate, so that an excess is reported and not only refused."""


@dataclass(frozen=True)
class Task:
    """Inputs of one target that a worker reads.

    first, count: number of the first input, and how many. is_repeated: a worker process has been killed in this task
    before.
    """

    target: str
    seed: int
    first: int
    count: int
    is_repeated: bool = False


def run_worker(connection: Connection, number: Any, folder: str) -> None:
    """Carry out tasks until None is received.

    Sends for each task a Counter of outcomes, and a list of (number of the input, description of the finding). number:
    shared integer in which the worker stores the number of the present input; -1 for none. folder: temporary folder of
    the worker.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["TMPDIR"] = tempfile.tempdir = folder
    sys.stderr = sys.stdout = open(os.devnull, "w")  # noqa: SIM115 # readers print progress
    # Arrow's own allocator keeps the memory of damaged files, and the next reader would reach the limit without reason.
    os.environ["ARROW_DEFAULT_MEMORY_POOL"] = "system"
    readers: dict[str, MutantReader] = {}
    targets = list_targets()
    while (task := connection.recv()) is not None:
        try:
            if task.target not in readers:
                _lift_limit()  # set by the previous task; the import of libraries allocates much memory
                own = Path(folder) / task.target
                own.mkdir()
                readers[task.target] = MutantReader(targets[task.target], own)
            connection.send(_run_task(readers[task.target], task, number))
        except Exception as error:  # of the valid files: reported as a finding of the whole target
            connection.send((Counter(), [(-1, f"the valid files are not read: {type(error).__name__}: {error}")]))


def _run_task(reader: MutantReader, task: Task, number: Any) -> tuple[Counter[str], list[tuple[int, str]]]:
    """Read the inputs of one task.

    number: shared integer in which the number of the present input is stored; -1 for none. Returns the number of inputs
    by outcome, and (number, description) of each finding.
    """
    counts: Counter[str] = Counter()
    findings = []
    _limit_memory()
    for index in range(task.first, task.first + task.count):
        mutant = reader.maker.make(task.seed, index)
        base = _read_peak()
        number.value = index
        outcome = reader.judge(mutant)
        number.value = -1
        if _read_peak() > base + MEMORY_MAX:
            outcome = Outcome(FINDING, f"memory: the reader needs {(_read_peak() - base) >> 20} MiB")
        counts[outcome.kind] += 1
        if outcome.kind == FINDING:
            findings.append((index, outcome.text))
    return counts, findings


def _read_peak() -> int:
    """Return the largest memory that the process has had so far, in bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _lift_limit() -> None:
    """Remove the limit of the private memory until the next `_limit_memory`."""
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def _limit_memory() -> None:
    """Limit the private memory of the process to its present size plus the permitted additional memory."""
    # The sixth number of statm is the size of data and stack in pages, which RLIMIT_DATA limits.
    present = int(Path("/proc/self/statm").read_text().split()[5]) * resource.getpagesize()
    limit = present + MEMORY_MAX + _MARGIN
    resource.setrlimit(resource.RLIMIT_DATA, (limit, resource.getrlimit(resource.RLIMIT_DATA)[1]))
