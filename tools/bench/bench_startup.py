"""Processor time of the start of the program and of the package, as a ratio to its limit."""

import resource
import statistics
import subprocess
import sys
from pathlib import Path

from figures import Figure

REPEATS = 7
HELP_LIMIT_S, IMPORT_LIMIT_S = 0.4, 0.1
"""Limits of the requirements of release 0.2.0, in seconds of processor time."""


def _measure_child_seconds(command: list[str]) -> float:
    """Run a command, and return its user and system time in seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def _measure_median_seconds(command: list[str]) -> float:
    """Measure the median processor time in s of `REPEATS` runs of a command.

    A first run, which fills the file cache, is excluded.
    """
    _measure_child_seconds(command)  # fills the file cache and writes the compiled modules
    return statistics.median(_measure_child_seconds(command) for _ in range(REPEATS))


def measure() -> list[Figure]:
    """Run the benchmark of the start of `taxel --help` and of `import taxel`.

    The latter excludes the start of the interpreter.
    """
    empty = _measure_median_seconds([sys.executable, "-c", ""])
    imported = max(_measure_median_seconds([sys.executable, "-c", "import taxel"]) - empty, 1e-4)
    helped = _measure_median_seconds([str(Path(sys.executable).with_name("taxel")), "--help"])
    return [
        Figure(
            "start: taxel --help",
            HELP_LIMIT_S / helped,
            1.0,
            f"processor time of {HELP_LIMIT_S:g} s",
            f"{helped * 1e3:.0f} ms of processor time, {empty * 1e3:.0f} ms of these by the interpreter",
        ),
        Figure(
            "start: import taxel",
            IMPORT_LIMIT_S / imported,
            1.0,
            f"processor time of {IMPORT_LIMIT_S:g} s",
            f"{imported * 1e3:.0f} ms of processor time after the start of the interpreter",
        ),
    ]
