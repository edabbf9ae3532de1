"""Choose the tests that `make test` leaves to `make test-slow`, from the times of a run, `make test-times`.

The times do not contain fixtures: the remaining tests of a file still need them.

Example: python tools/test_times/choose_slow_tests.py build/test_times.xml --budget-s 220
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

from taxel.output import write_whole

ROOT = Path(__file__).resolve().parents[2]
LIST = ROOT / "host" / "tests" / "slow_tests.txt"
HEADER = "# Tests that make test-slow runs, not make test. Written by make test-times; longest test first.\n"

SHORTEST_S = 0.05
"""Time below which a test is never chosen: its removal would hardly change the sum."""


def read_times(path: Path) -> dict[str, float]:
    """Read the seconds of each test from a JUnit file, by the test's node id; skipped tests are omitted."""
    times: dict[str, float] = {}
    for case in ElementTree.parse(path).getroot().iter("testcase"):
        if case.find("skipped") is None:
            times[_to_node_id(case.get("classname", ""), case.get("name", ""))] = float(case.get("time", "0"))
    return times


def _to_node_id(classname: str, name: str) -> str:
    """Convert the names of a JUnit file, "host.tests.a.test_b.TestC" and "test_d[e]", to a node id of pytest.

    Exits the program if the module does not exist.
    """
    parts = classname.split(".")
    for number in range(len(parts), 0, -1):
        path = "/".join(parts[:number]) + ".py"
        if (ROOT / path).is_file():
            return "::".join([path, *parts[number:], name])
    raise SystemExit(f"{classname}: expected the module of a test, found no file; run the tests in this folder")


def choose(times: dict[str, float], budget_s: float) -> list[str]:
    """Choose the longest tests until the others take at most `budget_s` seconds.

    The quickest test of each file and tests shorter than `SHORTEST_S` are never chosen.
    """
    remaining = Counter(node_id.split("::")[0] for node_id in times)
    total = sum(times.values())
    chosen = []
    for node_id, seconds in sorted(times.items(), key=lambda pair: (-pair[1], pair[0])):
        file = node_id.split("::")[0]
        if total <= budget_s or seconds < SHORTEST_S:
            break
        if remaining[file] > 1:
            remaining[file] -= 1
            total -= seconds
            chosen.append(node_id)
    return chosen


def read_list() -> list[str]:
    """Return the node ids in the present list of slow tests."""
    return [line for line in LIST.read_text().splitlines() if line and not line.startswith("#")]


def main() -> int:
    """Choose the slow tests and write their list."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("junit", type=Path, help="JUnit file of a run of all tests on an idle machine")
    parser.add_argument(
        "--budget-s", type=float, default=230.0, help="time of the other tests without their fixtures, s"
    )
    parser.add_argument(
        "--add", action="store_true", help="keep the listed tests; the file has times of the other tests (test-python)"
    )
    options = parser.parse_args()
    try:
        times = read_times(options.junit)
    except (OSError, ElementTree.ParseError) as error:
        print(f"error: {options.junit}: {error}; run make test-times", file=sys.stderr)
        return 1
    kept = [node_id for node_id in read_list() if node_id not in times] if options.add else []
    chosen = choose(times, options.budget_s)
    rest = sum(times.values()) - sum(times[node_id] for node_id in chosen)
    chosen = [*kept, *chosen]
    write_whole(LIST, HEADER + "".join(f"{node_id}\n" for node_id in chosen))
    print(f"{len(chosen)} of {len(times) + len(kept)} tests are slow; the others take {rest:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
