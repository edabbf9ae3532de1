"""What ran where: the table at the end of the suite."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping

import pytest

from hil_tests.harness.needs import NOT_POSSIBLE, is_not_possible

COLUMNS = ("passed", "failed", "not possible")


def counted(reports: Iterable[pytest.TestReport]) -> dict[str, Counter[str]]:
    """Outcomes of each suite (a test file without `test_`), and under `lacks ...` what was missing."""
    suites: dict[str, Counter[str]] = defaultdict(Counter)
    for report in reports:
        suite = report.nodeid.split("::")[0].rsplit("/", 1)[-1].removeprefix("test_").removesuffix(".py")
        if is_not_possible(report):
            suites[suite]["not possible"] += 1
            assert isinstance(report.longrepr, tuple)
            suites[suite]["lacks " + report.longrepr[2].split(NOT_POSSIBLE)[1]] += 1
        elif report.skipped and isinstance(report.longrepr, tuple):
            suites[suite]["not possible"] += 1
            suites[suite]["lacks " + report.longrepr[2].removeprefix("Skipped: ")] += 1
        elif report.when == "call" or report.failed:
            suites[suite]["passed" if report.passed else "failed"] += 1
    return dict(suites)


def lines_of(suites: Mapping[str, Counter[str]], rig: str) -> list[str]:
    """The table, a line each."""
    width = max([len(name) for name in suites] + [len("suite")])
    lines = [f"{'suite':<{width}}  " + "  ".join(f"{column:>12}" for column in COLUMNS) + f"   rig: {rig}"]
    for name, outcome in sorted(suites.items()):
        lacks = ", ".join(sorted(key.removeprefix("lacks ") for key in outcome if key.startswith("lacks ")))
        numbers = "  ".join(f"{outcome[column]:>12}" for column in COLUMNS)
        lines.append(f"{name:<{width}}  {numbers}" + (f"   lacks {lacks}" if lacks else ""))
    total = sum(suites.values(), Counter())
    lines.append(f"{'all':<{width}}  " + "  ".join(f"{total[column]:>12}" for column in COLUMNS))
    return lines
