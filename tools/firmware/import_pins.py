"""Write the pins of a board as a table of pins.toml, from a KiCad netlist or a CSV file.

    python tools/firmware/import_pins.py board.net --part U1 --out pins_of_my_board.toml
    python tools/firmware/import_pins.py board.csv

The nets of the part are found by their names, in capitals or not, with or without the path of a sheet: SCL, SDA, CMOD,
or CINT_A and CINT_B, TX0, TX1, ... and RX0, RX1, ... of a sensor board; SCL, SDA, UART_RX, UART_TX, UART_RTS of a hub.
A CSV file has the columns `net` and `pin`.
"""

import argparse
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from board_header import FIXED, HUB_PINS, SENSOR_PINS, TWO_CAPACITORS, PinsError, check_table
from netlist import read_nets

from taxel.errors import TaxelError
from taxel.output import write_whole

SINGLE: Final = {name.upper().replace("_", ""): name for name in (*SENSOR_PINS, *TWO_CAPACITORS, *HUB_PINS)}
"""Uses of single pins by the name of the net without underscores."""

LINE: Final = re.compile(r"(TX|RX)(\d+)")


def build_table(path: str, nets: Mapping[str, Sequence[str]]) -> tuple[str, dict[str, Any], list[str]]:
    """Build the pin table of a board from its nets.

    nets: names of the nets by port pin. Returns the table's name (`sensor` or `hub`), the pins by use, and the other
    pins with their nets. Raises PinsError for a missing or doubled line and for a wrong pin.
    """
    single: dict[str, str] = {}
    lines: dict[str, dict[int, str]] = {"tx": {}, "rx": {}}
    others = []
    for pin, names in sorted(nets.items()):
        for net in names:
            name = net.rsplit("/", 1)[-1].upper().replace("_", "")
            match = LINE.fullmatch(name)
            if match is not None:
                _store_pin(path, lines[match[1].lower()], int(match[2]), pin, net)
            elif name in SINGLE:
                _store_pin(path, single, SINGLE[name], pin, net)
            else:
                others.append(f"{pin}: {net}")
    board = "hub" if "uart_rx" in single else "sensor"
    table: dict[str, Any] = dict(single)
    for use, numbered in lines.items():
        missing = sorted(set(range(len(numbered))) - set(numbered))
        if missing:
            raise PinsError(path, f"{use.upper()}{missing[0]}", "nets numbered from 0 without a gap", "no such net")
        if numbered:
            table[use] = [numbered[number] for number in sorted(numbered)]
    has_two = "cint_a" in single or "cint_b" in single
    needed = HUB_PINS if board == "hub" else TWO_CAPACITORS if has_two else SENSOR_PINS
    check_table(path, board, table, needed, FIXED)
    if board == "sensor" and not (lines["tx"] and lines["rx"]):
        raise PinsError(path, "TX0, RX0", "a net of a TX line and of an RX line, or more", "none")
    return board, table, others


def _store_pin(path: str, uses: dict[Any, str], use: Any, pin: str, net: str) -> None:
    """Store `pin` as the pin of `use`. Raises PinsError, which names `net`, if the use has a pin already."""
    if use in uses:
        raise PinsError(path, net, "one pin", f"{uses[use]} and {pin}")
    uses[use] = pin


def format_table(source: str, board: str, table: Mapping[str, Any]) -> str:
    """Return the pin table as the text of a TOML file. source: name of the imported file."""
    text = [f"# Pins of a {'hub' if board == 'hub' else 'sensor board'}, from {source}.", "", f"[{board}]"]
    for use, pins in table.items():
        quoted = [f'"{pin}"' for pin in ([pins] if isinstance(pins, str) else pins)]
        text.append(f"{use} = {quoted[0] if isinstance(pins, str) else '[' + ', '.join(quoted) + ']'}")
    return "\n".join(text) + "\n"


def main() -> int:
    """Write the pin table, and list unused pins on standard error.

    After a one-line error message the exit status is 1.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("netlist", type=Path, help="KiCad netlist, or CSV file with the columns net and pin")
    parser.add_argument("--part", default="U1", help="reference of the processor in a KiCad netlist")
    parser.add_argument("--out", type=Path, help="file to write; default: standard output")
    options = parser.parse_args()
    try:
        board, table, others = build_table(str(options.netlist), read_nets(options.netlist, options.part))
        text = format_table(options.netlist.name, board, table)
        if options.out is None:
            print(text, end="")
        else:
            write_whole(options.out, text, overwrite=False)
    except (TaxelError, OSError) as error:
        print(f"import_pins: {error}", file=sys.stderr)
        return 1
    for each in others:
        print(f"not used: {each}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
