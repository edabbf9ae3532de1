"""Which rig the tests run on, and the table of what ran."""

from collections.abc import Iterator

import pytest

from hil_tests.harness.errors import RigError
from hil_tests.harness.needs import build_of, is_not_possible, needs_of, skip_what_is_not_possible
from hil_tests.harness.rig import Rig, abilities_of, opened
from hil_tests.harness.rig_file import RigDescription, load_rig
from hil_tests.harness.table import counted, lines_of
from taxel.skin import Skin


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--rig", default="virtual", help="the rig under test: virtual (default), or a rig file")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "needs(ability, ...): what a rig must be able to do for this test")
    config.addinivalue_line("markers", "world(...): how a virtual rig is put together for this test")
    config.addinivalue_line("markers", "faulty_image: it writes a program on which an executed processor faults")


@pytest.fixture(scope="session")
def description(request: pytest.FixtureRequest) -> RigDescription:
    try:
        return load_rig(request.config.getoption("--rig"))
    except RigError as error:
        pytest.exit(str(error), returncode=2)


@pytest.fixture
def rig(request: pytest.FixtureRequest, description: RigDescription) -> Iterator[Rig]:
    """The rig, open. A virtual one is new in every test."""
    needs = needs_of(request)
    skip_what_is_not_possible(needs, abilities_of(description))
    with opened(description, build_of(request, description.hand), counts="counts" in needs) as rig:
        yield rig


@pytest.fixture
def skin(rig: Rig) -> Iterator[Skin]:
    """The rig's skin, streaming."""
    with Skin(rig.uart.link(), rig.hand) as skin:
        yield skin


def pytest_report_teststatus(report: pytest.TestReport) -> tuple[str, str, tuple[str, dict[str, bool]]] | None:
    if report.when == "setup" and is_not_possible(report):
        return "not possible", "n", ("NOT POSSIBLE", {"yellow": True})
    return None


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    reports = [
        report
        for reports in terminalreporter.stats.values()
        for report in reports
        if isinstance(report, pytest.TestReport) and report.nodeid.startswith("hil_tests/")
    ]
    if reports:
        terminalreporter.section("hardware in the loop")
        for line in lines_of(counted(reports), terminalreporter.config.getoption("--rig")):
            terminalreporter.write_line(line)
