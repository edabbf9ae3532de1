"""Nets of one part, from a KiCad netlist or a CSV file.

KiCad (File > Export > Netlist, versions 5 to 9) writes S-expressions:
`(export (nets (net (name "/TX0") (node (ref "U1") (pin "5") (pinfunction "P2[0]")))))`.
"""

import csv
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from board_header import PinsError

from taxel.input_files.regular_file import read_regular_file

SIZE_MAX: Final = 1 << 26
DEPTH_MAX: Final = 100
TOKEN: Final = re.compile(r'[()]|"(?:\\.|[^"\\])*"|[^\s()"]+')
PORT_PIN: Final = re.compile(r"P([0-4])[._\[]?([0-7])\]?(?![0-9])")

Node = list["Node | str"]


def read_nets(path: Path, reference: str) -> dict[str, list[str]]:
    """Read the names of the nets at each port pin, such as {"P2.0": ["/TX0"]}. reference: of the part, such as "U1".

    A CSV file has the columns `net` and `pin`, and the reference is ignored. Raises PinsError and FileError with one
    line.
    """
    try:
        text = read_regular_file(path, SIZE_MAX).decode("utf-8")
    except UnicodeDecodeError:
        raise PinsError(str(path), "file", "text in UTF-8", "other bytes") from None
    pairs = _read_kicad(path, text, reference) if text.lstrip().startswith("(") else _read_csv(path, text)
    nets: dict[str, list[str]] = {}
    for pin, net in pairs:
        nets.setdefault(pin, []).append(net)
    if not nets:
        raise PinsError(str(path), reference, "nets at port pins such as P2.0", "none; check the reference of the part")
    return nets


def _read_csv(path: Path, text: str) -> Iterator[tuple[str, str]]:
    """Pins and nets of a CSV file."""
    rows = csv.DictReader(text.splitlines())
    if not {"net", "pin"} <= set(rows.fieldnames or ()):
        raise PinsError(str(path), "line 1", "the columns net and pin, or a KiCad netlist", repr(rows.fieldnames))
    for number, row in enumerate(rows, 2):
        pin = _find_pin(row["pin"] or "")
        if pin is None:
            raise PinsError(str(path), f"line {number}, pin", "a port pin such as P2.0", repr(row["pin"]))
        yield pin, (row["net"] or "").strip()


def _read_kicad(path: Path, text: str, reference: str) -> Iterator[tuple[str, str]]:
    """Port pins and nets of a part in a KiCad netlist. Other pins of the part, such as the supply, are left out."""
    tree = _parse(path, text)
    for net in _children(_first(tree, "nets"), "net"):
        name = _value(net, "name")
        for node in _children(net, "node"):
            pin = _find_pin(_value(node, "pinfunction"))
            if _value(node, "ref") == reference and pin is not None:
                yield pin, name


def _find_pin(text: str) -> str | None:
    """The port pin that a text names: P2.0 for P2.0, P2_0, P2[0] and P20; None if it names none."""
    match = PORT_PIN.search(text)
    return None if match is None else f"P{match[1]}.{match[2]}"


def _parse(path: Path, text: str) -> Node:
    """Parse one S-expression. Raises PinsError for unbalanced or too deeply nested brackets."""
    stack: list[Node] = [[]]
    for match in TOKEN.finditer(text):
        token = match[0]
        if token == "(":
            stack.append([])
        elif token == ")":
            if len(stack) == 1:
                break
            complete = stack.pop()
            stack[-1].append(complete)
        else:
            stack[-1].append(re.sub(r"\\(.)", r"\1", token[1:-1]) if token[0] == '"' else token)
        if len(stack) > DEPTH_MAX:
            break
    if len(stack) != 1 or len(stack[0]) != 1 or not isinstance(stack[0][0], list):
        raise PinsError(str(path), "file", "a complete KiCad netlist", "unbalanced brackets; export the netlist again")
    return stack[0][0]


def _children(node: Node, name: str) -> list[Node]:
    """The lists below a list that begin with a name."""
    return [child for child in node if isinstance(child, list) and child[:1] == [name]]


def _first(node: Node, name: str) -> Node:
    """The first list below a list that begins with a name; empty if there is none."""
    return next(iter(_children(node, name)), [])


def _value(node: Node, name: str) -> str:
    """The text of a list such as (name "TX0") below a list; empty if there is none."""
    return next((part for part in _first(node, name)[1:] if isinstance(part, str)), "")
