"""`taxel bench`."""

from __future__ import annotations

import getpass
import platform
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Final

import typer
from rich.console import Console
from rich.progress import BarColumn, TaskID, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bars

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel_tools.bench.keeping import check_place, keep
from taxel_tools.bench.phases import PHASES
from taxel_tools.bench.running import (
    Who,
    check_fit,
    default_plan,
    only,
    only_board,
    open_bench,
    open_probe,
    test_board,
)
from taxel_tools.bench.station import Station, open_station
from taxel_tools.cli_common import URL_HELP, parse_address, print_json, print_table
from taxel_tools.testing.operator import NoOperator, Operator, TerminalOperator
from taxel_tools.testing.plan import Plan, read_plan
from taxel_tools.testing.record import Outcome, TestRecord

PROBES: Final = "none, operator, emulated, or gcode:///dev/ttyUSB1?x=..&y=..&touch_z=..&spring_n_mm=.."
NOT_TESTED: Final = 2
EXIT: Final = {Outcome.PASS: 0, Outcome.FAIL: 1, Outcome.ERROR: NOT_TESTED, Outcome.SKIP: NOT_TESTED}


def bench_command(
    url: Annotated[str, typer.Argument(help=URL_HELP)],
    board: Annotated[str | None, typer.Option(help="Address; not needed where only one board is plugged in.")] = None,
    plan: Annotated[Path | None, typer.Option(help="Test plan (TOML); without it the standard one.")] = None,
    serial: Annotated[str | None, typer.Option(help="Serial number; without it the operator is asked.")] = None,
    operator: Annotated[str | None, typer.Option(help="Who tests; without it the name of the login.")] = None,
    station: Annotated[str | None, typer.Option(help="Where; without it the name of this computer.")] = None,
    probe: Annotated[str | None, typer.Option(help=PROBES)] = None,
    hand: Annotated[str, typer.Option(help="Hand description: names and geometry of the board's kind.")] = "allegro",
    phase: Annotated[
        list[str] | None, typer.Option(help="Of the plan only this phase, and what names faults; may be repeated.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for reports; each test gets one in it.")] = Path("out/bench"),
    history: Annotated[
        Path | None, typer.Option(help="SQLite file of earlier tests; without it history.sqlite in --out.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Test one sensor board: identity, opens and shorts, noise, drift, bus, every taxel, loading curve, smallest force.

    Writes report.html, result.json and junit.xml. Exit status: 0 passed, 1 failed, 2 could not be tested.

    Example: taxel bench "emulator:?board=0x22" --serial FT-0001
    """
    console = Console(stderr=True, soft_wrap=True)
    try:
        chosen = _plan(plan, phase, hand)
        person = _person(console, chosen, serial, probe)
        history = history or out / "history.sqlite"
        check_place(out, history)
        address = parse_address(board, "--board") if board else None
        with open_bench(url) as (wire, emulated):
            kinds = emulated.hand if emulated else load_hand(hand)
            under_test = open_station(wire, only_board(wire) if address is None else address, kinds)
            serial_number = serial if serial is not None else person.ask_serial()
            who = Who(serial_number, operator if operator is not None else _login(), station or platform.node())
            under_test.probe = open_probe(probe, under_test, emulated, person)
            try:
                record = _run(chosen, under_test, who, person, console)
            finally:
                under_test.probe.close()
        folder = keep(record, out, history)
    except (TaxelError, OSError) as error:  # 1, the status of any other command's errors, means a bad board here
        print(f"taxel: {_line(error)}", file=sys.stderr)
        raise typer.Exit(NOT_TESTED) from None
    if as_json:
        print_json({"outcome": str(record.outcome), "folder": str(folder), "findings": record.findings()})
    else:
        _print(record, folder)
    raise typer.Exit(EXIT[record.outcome])


class _AtTerminal(TerminalOperator):
    """Somebody at the terminal; progress bars make room for what is asked."""

    bars: Bars | None = None

    def prompt(self, text: str) -> None:
        """As `Operator`."""
        with self._room():
            super().prompt(text)

    def confirm(self, text: str) -> bool:
        """As `Operator`."""
        with self._room():
            return super().confirm(text)

    @contextmanager
    def _room(self) -> Iterator[None]:
        if self.bars is not None:
            self.bars.stop()
        try:
            yield
        finally:
            if self.bars is not None:
                self.bars.start()


def _plan(file: Path | None, phases: list[str] | None, hand: str) -> Plan:
    plan = read_plan(file) if file else default_plan()
    check_fit(plan, (board.kind.name for board in load_hand(hand).boards))
    return only(plan, phases) if phases else plan


def _person(console: Console, plan: Plan, serial: str | None, probe: str | None) -> Operator:
    """Who can be asked. Raises `TaxelError` if nobody can, and somebody must."""
    if serial is not None:
        plan.check_serial(serial)
    if console.is_terminal and sys.stdin.isatty():
        return _AtTerminal(console, plan.check_serial)
    if serial is None:
        raise TaxelError("--serial: nobody is at a terminal to be asked; give the board's serial number")
    if probe == "operator":
        raise TaxelError("--probe operator: nobody is at a terminal to be told what to press; choose another probe")
    return NoOperator()


def _line(error: TaxelError | OSError) -> str:
    if isinstance(error, OSError) and error.filename and error.strerror:
        return f"{error.filename}: {error.strerror}"
    return str(error).splitlines()[0]


def _login() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""


def _run(plan: Plan, station: Station, who: Who, person: Operator, console: Console) -> TestRecord:
    titles = {phase.name: phase.title for phase in PHASES}
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn())
    with Bars(*columns, console=console) as bars:
        tasks: dict[str, TaskID] = {}

        def report(phase: str, fraction: float) -> None:
            if phase not in tasks:
                tasks[phase] = bars.add_task(titles[phase], total=1.0)
            bars.update(tasks[phase], completed=fraction)

        if isinstance(person, _AtTerminal):
            person.bars = bars
        return test_board(plan, station, who, report)


def _print(record: TestRecord, folder: Path) -> None:
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
    for found in record.findings():
        print(f"{found.fault} at {found.place}: {found.text}")
    automatic = sum(phase.seconds for phase in record.phases if phase.automatic)
    print(
        f"{record.serial_number}: {str(record.outcome).upper()} in {record.seconds:.1f} s of bench time "
        f"({automatic:.1f} s automatic); report: {folder / 'report.html'}"
    )
