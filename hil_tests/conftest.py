"""Fixtures `rig` and `skin`, the option `--rig`, and the table of results."""

from collections.abc import Iterator

import pytest

from hil_tests.harness.requirements import (
    get_required_abilities,
    get_world_build,
    is_not_possible,
    skip_if_not_possible,
)
from hil_tests.harness.result_table import count_outcomes, format_table
from hil_tests.harness.rig import Rig, get_abilities, open_rig
from hil_tests.harness.rig_file import RigDescription, load_rig
from taxel.errors import TaxelError
from taxel.skin import Skin


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--rig", default="virtual", help="rig under test: virtual (default), cortex-m0, or a rig file")


def pytest_configure(config: pytest.Config) -> None:
    """Register the pytest markers of the hardware-in-the-loop tests."""
    config.addinivalue_line("markers", "needs(ability, ...): abilities of the rig that this test requires")
    config.addinivalue_line("markers", "world(...): emulated world for this test, on a virtual rig")
    config.addinivalue_line("markers", "faulty_image: the test programs an image on which an executed processor faults")


@pytest.fixture(scope="session")
def description(request: pytest.FixtureRequest) -> RigDescription:
    """Content of the rig file of this test run."""
    try:
        return load_rig(request.config.getoption("--rig"))
    except TaxelError as error:
        pytest.exit(str(error), returncode=2)


@pytest.fixture
def rig(request: pytest.FixtureRequest, description: RigDescription) -> Iterator[Rig]:
    """The rig with open drivers. Each test has its own emulated world."""
    skip_if_not_possible(get_required_abilities(request), get_abilities(description))
    with open_rig(description, get_world_build(request, description.hand)) as rig:
        yield rig


@pytest.fixture
def skin(rig: Rig) -> Iterator[Skin]:
    """The skin of the rig, streaming frames."""
    with Skin(rig.uart.open_link(), rig.hand) as skin:
        yield skin


def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, tuple[str, dict[str, bool]]] | None:
    """Report a test that the selected rig cannot run as "not possible" instead of skipped."""
    if report.when == "setup" and is_not_possible(report):
        return "not possible", "n", ("NOT POSSIBLE", {"yellow": True})
    return None


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the table of passed, failed and not possible tests of the rig at the end of the pytest output."""
    reports = [
        report
        for reports in terminalreporter.stats.values()
        for report in reports
        if isinstance(report, pytest.TestReport) and report.nodeid.startswith("hil_tests/")
    ]
    if reports:
        terminalreporter.section("hardware in the loop")
        for line in format_table(count_outcomes(reports), terminalreporter.config.getoption("--rig")):
            terminalreporter.write_line(line)
