"""The command `taxel rate`."""

from typing import Annotated

import typer

from taxel.errors import TaxelError
from taxel_tools.cli_common import URL_HELP, count_boards, print_json, print_table
from taxel_tools.open_wire import open_stream
from taxel_tools.rate import SkinRate, measure_rate

SECONDS_MIN, SECONDS_MAX = 1.0, 3600.0


def rate_command(
    url: Annotated[str, typer.Argument(help=URL_HELP)],
    seconds: Annotated[float, typer.Option(help="Duration of the measurement, seconds.")] = 10.0,
    scl_hz: Annotated[
        float | None, typer.Option(help="Clock of the I2C bus, Hz, if it is not that of the URL.")
    ] = None,
    at_least: Annotated[
        float | None, typer.Option(help="Exit status 1 below this share of the ceiling, percent.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure the frame rate of a skin relative to the ceiling of its I2C bus.

    The ceiling is the rate of a bus without pauses that transfers one snapshot of each board in turn. Exit status 1 if
    a frame is missing without a cause in the counters of the hub.

    Example: taxel rate "emulator:?wire=i2c&scl_hz=100000"
    """
    if not SECONDS_MIN <= seconds <= SECONDS_MAX:
        raise TaxelError(f"--seconds: expected {SECONDS_MIN:g} to {SECONDS_MAX:g}, found {seconds:g}")
    if scl_hz is not None and not scl_hz > 0.0:
        raise TaxelError(f"--scl-hz: expected a frequency above 0 Hz, found {scl_hz:g}")
    with open_stream(url) as (link, bus_scl_hz):
        rate = measure_rate(link, scl_hz or bus_scl_hz, seconds)
    if as_json:
        print_json(rate)
    else:
        _print_rate(rate)
    is_too_slow = at_least is not None and 100.0 * rate.share < at_least
    if is_too_slow:
        print(f"below {at_least:g} % of the ceiling; close other programs, or see docs/how-to-run-without-a-hub.md")
    if is_too_slow or rate.unexplained:
        raise typer.Exit(1)


def _print_rate(rate: SkinRate) -> None:
    """Print the frame rate of each board, and the frame rate of the skin relative to the ceiling of the bus."""
    print_table(("board", "Hz"), [(f"0x{address:02X}", f"{hz:.2f}") for address, hz in rate.boards.items()])
    print(
        f"{rate.hz:.2f} Hz, {100.0 * rate.share:.1f} % of the ceiling of {rate.ceiling_hz:.2f} Hz of an I2C bus at "
        f"{rate.scl_hz / 1e3:g} kHz with {count_boards(len(rate.boards))}"
    )
    print(f"{rate.frames} frames in {rate.seconds:.1f} s, {rate.missing} missing, {rate.unexplained} unexplained")
