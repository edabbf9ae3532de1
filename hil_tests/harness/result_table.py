"""Table of the results of each suite on a rig, printed at the end of a test run."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping

import pytest

from hil_tests.harness.requirements import NOT_POSSIBLE, is_not_possible

COLUMNS = ("passed", "failed", "not possible")


def count_outcomes(reports: Iterable[pytest.TestReport]) -> dict[str, Counter[str]]:
    """Count the tests by outcome for each suite (the name of a test file without `test_`).

    The outcomes of a suite are those of `COLUMNS`, and "lacks ..." for each reason why tests were not possible.
    """
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


def format_table(suites: Mapping[str, Counter[str]], rig: str) -> list[str]:
    """Format the table with the numbers of passed, failed and not possible tests of each suite as lines of text.

    rig: name of the rig.
    """
    width = max([len(name) for name in suites] + [len("suite")])
    lines = [f"{'suite':<{width}}  " + "  ".join(f"{column:>12}" for column in COLUMNS) + f"   rig: {rig}"]
    for name, outcomes in sorted(suites.items()):
        lacks = ", ".join(sorted(key.removeprefix("lacks ") for key in outcomes if key.startswith("lacks ")))
        numbers = "  ".join(f"{outcomes[column]:>12}" for column in COLUMNS)
        lines.append(f"{name:<{width}}  {numbers}" + (f"   lacks {lacks}" if lacks else ""))
    total = sum(suites.values(), Counter())
    lines.append(f"{'all':<{width}}  " + "  ".join(f"{total[column]:>12}" for column in COLUMNS))
    return lines
