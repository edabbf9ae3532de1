"""The command `taxel bench`."""

import getpass
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.optional import require_packages
from taxel_tools.bench.board_under_test import BoardUnderTest, open_board
from taxel_tools.bench.running import (
    RecordLabels,
    find_single_board,
    load_default_plan,
    load_plan_phases,
    open_bench,
    open_probe,
    run_board_test,
    select_phases,
)
from taxel_tools.bench.saving import check_output, save_record
from taxel_tools.cli_common import URL_HELP, parse_address, print_json, print_table
from taxel_tools.open_wire import reject_original_hub
from taxel_tools.testing.operator import NoOperator, Operator, TerminalOperator
from taxel_tools.testing.plan import Plan, read_plan
from taxel_tools.testing.record import Outcome, TestRecord

PROBE_HELP: Final = (
    "none, operator, emulated, gcode:///dev/ttyUSB1?x=..&y=..&touch_z=..&spring_n_mm=.., or a probe of another package."
)
NOT_TESTED: Final = 2
REPORT_PACKAGES: Final = ("jinja2", "matplotlib")
"""Packages of the extra `bench`: the page of the report and its pictures."""
EXIT_STATUS: Final = {Outcome.PASS: 0, Outcome.FAIL: 1, Outcome.ERROR: NOT_TESTED, Outcome.SKIP: NOT_TESTED}


@dataclass(frozen=True)
class _BenchArguments:
    """Arguments of `taxel bench` that concern the board, the operator and the probe."""

    url: str
    board: str | None
    serial_number: str | None
    operator_name: str
    station: str
    probe: str | None
    hand: str


def bench_command(
    url: Annotated[str, typer.Argument(help=URL_HELP)],
    board: Annotated[str | None, typer.Option(help="Address of the board; optional with a single board.")] = None,
    plan: Annotated[Path | None, typer.Option(help="Test plan (TOML); default: the plan of the package.")] = None,
    serial: Annotated[str | None, typer.Option(help="Serial number; default: entered by the operator.")] = None,
    operator: Annotated[str | None, typer.Option(help="Name of the operator; default: the login name.")] = None,
    station: Annotated[str | None, typer.Option(help="Name of the station; default: the host name.")] = None,
    probe: Annotated[str | None, typer.Option(help=PROBE_HELP)] = None,
    hand: Annotated[str, typer.Option(help="Hand description with the names and geometry of the kinds.")] = "original",
    phase: Annotated[
        list[str] | None, typer.Option(help="Only this phase of the plan, and the merging phase; may be repeated.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of the reports; each test gets a new folder in it.")] = Path(
        "out/bench"
    ),
    history: Annotated[
        Path | None, typer.Option(help="SQLite file of all tests; default: history.sqlite in --out.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Test one sensor board: identity, opens and shorts, noise, drift, bus, response of every taxel, loading curve.

    Writes report.html, result.json and junit.xml. Exit status: 0 passed, 1 failed, 2 could not be tested.

    Example: taxel bench "emulator:?board=0x1C" --serial FT-0001
    """
    console = Console(stderr=True, soft_wrap=True)
    arguments = _BenchArguments(
        url,
        board,
        serial,
        operator if operator is not None else _read_login_name(),
        station or platform.node(),
        probe,
        hand,
    )
    try:
        reject_original_hub(url)
        require_packages("taxel bench", "bench", *REPORT_PACKAGES)  # before the test, which takes minutes
        test_plan = _load_plan(plan, phase, hand)
        person = _find_operator(console, test_plan, arguments)
        history = history or out / "history.sqlite"
        check_output(out, history)
        record = _run_test(test_plan, arguments, person, console)
        folder = save_record(record, out, history)
    except (TaxelError, OSError) as error:  # Exit status 1, the usual status of errors, means a faulty board here.
        print(f"taxel: {_format_error(error)}", file=sys.stderr)
        raise typer.Exit(NOT_TESTED) from None
    if as_json:
        print_json({"outcome": str(record.outcome), "folder": str(folder), "findings": record.findings()})
    else:
        _print_record(record, folder)
    raise typer.Exit(EXIT_STATUS[record.outcome])


class _BenchOperator(TerminalOperator):
    """An operator at the terminal; progress bars are hidden during questions."""

    bars: Bars | None = None

    def prompt(self, text: str) -> None:
        """Show an instruction to the operator without progress bars and wait for Enter."""
        with self._hide_bars():
            super().prompt(text)

    @contextmanager
    def _hide_bars(self) -> Iterator[None]:
        """Hide the progress bars while the context is active."""
        if self.bars is not None:
            self.bars.stop()
        try:
            yield
        finally:
            if self.bars is not None:
                self.bars.start()


def _load_plan(file: Path | None, phases: list[str] | None, hand: str) -> Plan:
    """Read the test plan and check its phases for every board kind of the hand.

    file: plan file; None: the default plan. phases: names of the phases to run; None or empty: all. hand: name of
    the hand.
    """
    plan = read_plan(file) if file else load_default_plan()
    load_plan_phases(plan, (board.kind.name for board in load_hand(hand).boards))
    return select_phases(plan, phases) if phases else plan


def _find_operator(console: Console, plan: Plan, arguments: _BenchArguments) -> Operator:
    """Return the operator at the terminal, or `NoOperator` without a terminal.

    Raises `TaxelError` for an invalid serial number, or if the test needs an operator and there is no terminal.
    """
    if arguments.serial_number is not None:
        plan.check_serial_number(arguments.serial_number)
    if console.is_terminal and sys.stdin.isatty():
        return _BenchOperator(console, plan.check_serial_number)
    if arguments.serial_number is None:
        raise TaxelError("--serial: expected a serial number, found none and no terminal to enter it; add --serial")
    if arguments.probe == "operator":
        raise TaxelError("--probe: 'operator' requires a terminal, found none; choose another probe")
    return NoOperator()


def _format_error(error: TaxelError | OSError) -> str:
    """Format an error as one line, with the file name for errors of the operating system."""
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error).splitlines()[0]


def _read_login_name() -> str:
    """Return the login name of the user, or "" if the system has no name for the user."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""


def _run_test(plan: Plan, arguments: _BenchArguments, operator: Operator, console: Console) -> TestRecord:
    """Open bench, board and probe, run the test plan, close the probe, and return the record of the test."""
    address = parse_address(arguments.board, "--board") if arguments.board else None
    with open_bench(arguments.url) as (wire, emulated):
        hand = emulated.hand if emulated else load_hand(arguments.hand)
        board = open_board(wire, find_single_board(wire) if address is None else address, hand)
        serial_number = arguments.serial_number
        if serial_number is None:
            serial_number = operator.read_serial_number()
        labels = RecordLabels(serial_number, arguments.operator_name, arguments.station)
        board.probe = open_probe(arguments.probe, board, emulated, operator)
        try:
            return _run_with_bars(plan, board, labels, operator, console)
        finally:
            board.probe.close()


def _run_with_bars(
    plan: Plan, board: BoardUnderTest, labels: RecordLabels, operator: Operator, console: Console
) -> TestRecord:
    """Run a test plan on a board, with one progress bar for each phase; return the record of the test."""
    titles = {phase.name: phase.title for phase in load_plan_phases(plan)}
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Bars(*columns, console=console) as bars:
        tasks: dict[str, TaskID] = {}

        def report(phase: str, fraction: float) -> None:
            """Show the progress of a test phase, 0 to 1, in its own bar."""
            if phase not in tasks:
                tasks[phase] = bars.add_task(titles[phase], total=1.0)
            bars.update(tasks[phase], completed=fraction)

        if isinstance(operator, _BenchOperator):
            operator.bars = bars
        return run_board_test(plan, board, labels, report)


def _print_record(record: TestRecord, folder: Path) -> None:
    """Print the phases, the findings and the outcome of a board test. folder: folder that contains the reports."""
    rows = [
        (
            phase.title,
            str(phase.outcome),
            f"{phase.seconds:.1f} s",
            phase.problem or "; ".join(phase.notes if phase.outcome is Outcome.SKIP else ()),
        )
        for phase in record.phases
    ]
    print_table(("phase", "outcome", "time", ""), rows)
    for finding in record.findings():
        print(f"{finding.fault} at {finding.place}: {finding.text}")
    automatic_s = sum(phase.seconds for phase in record.phases if phase.automatic)
    print(
        f"{record.serial_number}: {str(record.outcome).upper()} in {record.seconds:.1f} s of bench time "
        f"({automatic_s:.1f} s automatic); report: {folder / 'report.html'}"
    )
