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
    """Read the names of the nets at each port pin of a part, such as {"P2.0": ["/TX0"]}.

    reference: the part's reference, such as "U1"; ignored for a CSV file, which has the columns `net` and `pin`. Raises
    PinsError and FileError with a one-line message.
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
    """Yield the port pin and the net of each row of a CSV file."""
    rows = csv.DictReader(text.splitlines())
    if not {"net", "pin"} <= set(rows.fieldnames or ()):
        raise PinsError(str(path), "line 1", "the columns net and pin, or a KiCad netlist", repr(rows.fieldnames))
    for number, row in enumerate(rows, 2):
        pin = _find_pin(row["pin"] or "")
        if pin is None:
            raise PinsError(str(path), f"line {number}, pin", "a port pin such as P2.0", repr(row["pin"]))
        yield pin, (row["net"] or "").strip()


def _read_kicad(path: Path, text: str, reference: str) -> Iterator[tuple[str, str]]:
    """Yield the port pins and nets of a part in a KiCad netlist.

    Other pins of the part, such as those of the supply, are omitted.
    """
    tree = _parse(path, text)
    for net in _find_lists(_find_first_list(tree, "nets"), "net"):
        name = _get_string(net, "name")
        for node in _find_lists(net, "node"):
            pin = _find_pin(_get_string(node, "pinfunction"))
            if _get_string(node, "ref") == reference and pin is not None:
                yield pin, name


def _find_pin(text: str) -> str | None:
    """Return the port pin that a name contains: P2.0 for P2.0, P2_0, P2[0] and P20; None if it contains none."""
    match = PORT_PIN.search(text)
    return None if match is None else f"P{match[1]}.{match[2]}"


def _parse(path: Path, text: str) -> Node:
    """Parse one S-expression to nested lists. Raises PinsError for unbalanced or too deeply nested brackets."""
    error = PinsError(str(path), "file", "a complete KiCad netlist", "unbalanced brackets; export the netlist again")
    stack: list[Node] = [[]]
    for match in TOKEN.finditer(text):
        token = match[0]
        if token == "(":
            stack.append([])
        elif token == ")":
            if len(stack) == 1:
                raise error
            complete = stack.pop()
            stack[-1].append(complete)
        else:
            stack[-1].append(re.sub(r"\\(.)", r"\1", token[1:-1]) if token[0] == '"' else token)
        if len(stack) > DEPTH_MAX:
            raise error
    if len(stack) != 1 or len(stack[0]) != 1 or not isinstance(stack[0][0], list):
        raise error
    return stack[0][0]


def _find_lists(node: Node, name: str) -> list[Node]:
    """Return the lists in `node` whose first element is `name`."""
    return [child for child in node if isinstance(child, list) and child[:1] == [name]]


def _find_first_list(node: Node, name: str) -> Node:
    """Return the first list in `node` whose first element is `name`; [] if there is none."""
    return next(iter(_find_lists(node, name)), [])


def _get_string(node: Node, name: str) -> str:
    """Return the string after `name` in a list such as (name "TX0") in `node`; "" if there is none."""
    return next((part for part in _find_first_list(node, name)[1:] if isinstance(part, str)), "")
