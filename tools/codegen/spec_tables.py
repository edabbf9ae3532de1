"""Write the generated parts of protocol/SPEC.md, between `<!-- generated: NAME -->` and `<!-- end -->`.

python tools/codegen/spec_tables.py            write them
python tools/codegen/spec_tables.py --check    exit status 1 if the page is stale
"""

import sys
from collections.abc import Callable
from pathlib import Path

from generated_files import write_or_check

from taxel_protocol import compact_tables
from taxel_protocol.frames import FRAMES
from taxel_protocol.framing import crc32, encode_frame, whiten
from taxel_protocol.names import Command, FrameType

SPEC = Path(__file__).resolve().parents[2] / "protocol" / "SPEC.md"
_BEGIN, _END = "<!-- generated: {} -->", "<!-- end -->"
_PER_ROW = 10
_START = bytes([1, Command.START])
"""Payload of the example frame: tag 1, command START."""


def _format_numbers(name: str) -> str:
    """Return the constants of the tuple `name` of `compact_tables` as a Markdown table with ten numbers per row.

    The first column is the index of the row's first number.
    """
    values: tuple[int, ...] = getattr(compact_tables, name)
    lines = [f"`{name}`, {len(values)} integers:", "", f"| index | {' | '.join(f'+{i}' for i in range(_PER_ROW))} |"]
    lines.append("|---" * (_PER_ROW + 1) + "|")
    for start in range(0, len(values), _PER_ROW):
        row = [str(value) for value in values[start : start + _PER_ROW]]
        lines.append(f"| {start} | {' | '.join(row + [''] * (_PER_ROW - len(row)))} |".replace("|  |", "| |"))
    return "\n".join(lines).replace("|  |", "| |")


def _format_addresses() -> str:
    """Return a Markdown table of the frame types: whether the payload begins with the address of a board."""
    lines = ["| type | name | first byte of the payload is an address that the receiver checks |", "|---|---|---|"]
    for frame_type, spec in FRAMES.items():
        lines.append(f"| 0x{frame_type:02X} | `{frame_type.name}` | {'yes' if spec.has_address else 'no'} |")
    return "\n".join(lines)


def _build_start_body(sequence: int) -> bytes:
    """Build the body of a frame with the command START, before whitening: header, payload and CRC."""
    head = bytes([FrameType.COMMAND]) + sequence.to_bytes(2, "little") + len(_START).to_bytes(2, "little")
    return head + _START + crc32(head + _START).to_bytes(4, "little")


def _find_sequence_with_final_zero() -> int:
    """Return the smallest sequence number with which the whitened body of the command START ends in a zero byte.

    COBS ends such a frame with an empty block, the code 0x01 without bytes; `_format_empty_block` shows this case.
    """
    for sequence in range(1 << 16):
        if whiten(_build_start_body(sequence))[-1] == 0:
            return sequence
    raise AssertionError("no sequence gives a body that ends in zero")


def _format_empty_block() -> str:
    """Return the example of a frame whose last block of the byte stuffing is empty: body, whitened body, wire bytes."""
    sequence = _find_sequence_with_final_zero()
    wire = encode_frame(FrameType.COMMAND, sequence, _START)
    body = _build_start_body(sequence)
    rows = {"body": body, "whitened": whiten(body), "wire": wire}
    lines = [f" {name:<9} {' '.join(f'{byte:02X}' for byte in data)}" for name, data in rows.items()]
    text = (
        f"The frame COMMAND (START, tag 1) with the sequence {sequence} has a whitened body that ends in a zero byte:"
    )
    return "\n".join([text, "", "```", *lines, "```"])


PARTS: dict[str, Callable[[], str]] = {
    "COMPACT_CUMULATIVE": lambda: _format_numbers("COMPACT_CUMULATIVE"),
    "COMPACT_GAINS": lambda: _format_numbers("COMPACT_GAINS"),
    "addresses": _format_addresses,
    "empty_block": _format_empty_block,
}


def replace_parts(text: str) -> str:
    """Return the page's text with all generated parts replaced.

    Raises ValueError if the mark of a part is missing.
    """
    for name, make in PARTS.items():
        head, begin, tail = text.partition(_BEGIN.format(name))
        _, end, tail = tail.partition(_END)
        if not begin or not end:
            raise ValueError(f"{SPEC.name} has no part between {_BEGIN.format(name)} and {_END}")
        text = f"{head}{begin}\n\n{make()}\n\n{end}{tail}"
    return text


def main() -> int:
    """Write the generated parts of the specification, or with --check compare them; the exit status is 1 if one is
    stale.
    """
    return write_or_check({SPEC: replace_parts(SPEC.read_text())})


if __name__ == "__main__":
    sys.exit(main())
