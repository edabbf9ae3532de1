"""The command `taxel bringup`."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Final

import typer

from taxel.errors import TaxelError
from taxel_tools.bringup.emulated_part import EmulatedPart, PartSettings, read_flash
from taxel_tools.bringup.findings import DIFFERS, list_findings
from taxel_tools.bringup.measuring import measure
from taxel_tools.bringup.ports import BytePort, SerialBytePort
from taxel_tools.bringup.result_file import write_results
from taxel_tools.cli_common import print_table

EMULATED: Final = "emulated:"


def bringup_command(
    port: Annotated[str, typer.Argument(help="Serial port of the board, such as /dev/ttyUSB0; or emulated:.")],
    out: Annotated[
        Path, typer.Option("--out", help="Result file (JSON); the list of the points is written beside it.")
    ] = Path("bringup.json"),
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing result files.")] = False,
    capacitor_pf: Annotated[
        float | None, typer.Option("--capacitor-pf", min=0.1, max=100, help="Known capacitor between P2.0 and P2.2.")
    ] = None,
    capacitors: Annotated[
        int,
        typer.Option("--capacitors", min=1, max=2, help="Integration capacitors: 1 (P4.2), or 2 (P3.6 and P3.7)."),
    ] = 1,
    supply_v: Annotated[float, typer.Option("--supply-v", min=1.7, max=5.5, help="Supply voltage of the board.")] = 3.3,
    image: Annotated[
        Path | None, typer.Option("--image", help="Image of the emulated part: build/psoc4200/images/bringup.hex.")
    ] = None,
    part: Annotated[
        list[str] | None,
        typer.Option("--part", help="Property or fault of the emulated part, such as irq_csd=14; repeatable."),
    ] = None,
) -> None:
    """Test the first board with the bring-up image, and compare it with the assumptions of the firmware.

    docs/bring-up.md describes each step. The exit status is 1 if a point differs from its assumption.

    Examples: taxel bringup /dev/ttyUSB0 --capacitor-pf 2.2; taxel bringup emulated: --image
    build/psoc4200/images/bringup.hex --part irq_csd=14
    """
    _refuse_existing(out, overwrite)
    connection = _open(port, image, part or [])
    try:
        results = measure(connection, lambda test: print(f"testing: {test}", flush=True))
    finally:
        connection.close()
    findings = list_findings(results, capacitor_pf, supply_v, capacitors)
    rows = [(str(each.step), each.point, each.expected, each.measured, each.status) for each in findings]
    print_table(("step", "point", "expected", "measured", "result"), rows)
    table = write_results(out, port, results, findings, overwrite)
    differing = [each for each in findings if each.status == DIFFERS]
    for each in differing:
        print(f"step {each.step} of docs/bring-up.md: {each.point}: {each.advice}")
    print(f"{len(differing)} of {len(findings)} points differ; results: {out}, {table}")
    raise typer.Exit(1 if differing else 0)


def _refuse_existing(out: Path, overwrite: bool) -> None:
    """Raise `TaxelError` if a result file exists and must not be replaced, or if `out` has the suffix of the table."""
    for path in (out, out.with_suffix(".md")):
        if path.exists() and not overwrite:
            raise TaxelError(f"{path}: exists already; choose another --out, or add --overwrite")
    if out.suffix == ".md":
        raise TaxelError(f"{out}: expected a name such as bringup.json; the list of the points has the suffix .md")


def _open(port: str, image: Path | None, part: list[str]) -> BytePort:
    """Open the serial port, or create the emulated part. Raises `TaxelError` with a one-line message.

    image, part: image and properties of the emulated part; only permitted with the port "emulated:".
    """
    if port != EMULATED:
        if image is not None or part:
            raise TaxelError(f"--image, --part: only for the port {EMULATED}, found {port}")
        return SerialBytePort(port)
    if image is None:
        raise TaxelError(f"--image: {EMULATED} needs the image; make firmware builds build/psoc4200/images/bringup.hex")
    return EmulatedPart(read_flash(image), _read_settings(part))


def _read_settings(part: list[str]) -> PartSettings:
    """Parse properties of the emulated part, each NAME=VALUE. Raises `TaxelError` for any other text."""
    names = {each.name for each in fields(PartSettings)}
    values: dict[str, float] = {}
    for text in part:
        name, separator, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if name not in names or not separator or not 0 <= number <= 1e6:
            raise TaxelError(f"--part {text}: expected NAME=NUMBER with one of {', '.join(sorted(names))}")
        values[name] = number
    return replace(PartSettings(), **values)
