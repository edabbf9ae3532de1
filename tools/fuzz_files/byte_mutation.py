"""Mutations of bytes: flipped, inserted, removed, repeated and moved ones, integers at their limits, text fragments."""

from __future__ import annotations

import re
import struct
from random import Random
from typing import Final

_INTEGERS: Final = ("<H", ">H", "<I", ">I", "<Q", ">Q")
_FRAGMENTS: Final = (
    b"\0", b"\xff", b"\xef\xbb\xbf", b"\r\n", b"\n\n", b",,", b"nan", b"inf", b"-1", b"1e308", b"1e999", b"9" * 5000,
    b"[" * 100_000, b'{"a":' * 20_000, b"a." * 300 + b"b = 1\n", b"# comment\n",
    b"\xed\xa0\x80", b"=", b'"', b"\\u0000",
)  # fmt: skip
_NUMBER: Final = re.compile(rb"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_NUMBERS: Final = (
    b"0", b"-1", b"1", b"255", b"256", b"65536", b"4294967296", b"18446744073709551616", b"1e308", b"-1e308", b"nan",
    b"inf", b"1e-320", b"0.1", b"1_0", b"0x10", b"", b"+5", b"00012", b"1.",
)  # fmt: skip
_BLOCKS: Final = (1, 2, 4, 8, 16, 64, 512, 4096)


def mutate_bytes(data: bytes, random: Random) -> tuple[bytes, str]:
    """Apply one, two or four random operations to bytes.

    Returns the changed bytes and a description of the operations.
    """
    changes = []
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        operation = random.choice(OPERATIONS)
        data = operation(data, random)
        changes.append(operation.__name__.strip("_").replace("_", " "))
    return data, "bytes: " + ", ".join(changes)


def _place(data: bytes, random: Random) -> int:
    """Return a random offset in `data`, 0 without data.

    The first 64 bytes, which are most often a header, are chosen more often.
    """
    return random.randrange(min(len(data), 64) if random.random() < 0.25 else len(data)) if data else 0


def _flip_bit(data: bytes, random: Random) -> bytes:
    """Flip one bit; empty data become one byte."""
    place = _place(data, random)
    return data[:place] + bytes([data[place] ^ 1 << random.randrange(8)]) + data[place + 1 :] if data else b"\1"


def _set_byte(data: bytes, random: Random) -> bytes:
    """Replace one byte with a value at a limit or a random value."""
    place = _place(data, random)
    return data[:place] + bytes([random.choice((0, 1, 127, 128, 255, random.randrange(256)))]) + data[place + 1 :]


def _remove_block(data: bytes, random: Random) -> bytes:
    """Remove a block of 1 to 4,096 bytes."""
    place = _place(data, random)
    return data[:place] + data[place + random.choice(_BLOCKS) :]


def _repeat_block(data: bytes, random: Random) -> bytes:
    """Repeat a block of 1 to 4,096 bytes 2, 3 or 50 times."""
    place, size = _place(data, random), random.choice(_BLOCKS)
    return data[:place] + data[place : place + size] * random.choice((2, 3, 50)) + data[place + size :]


def _move_block(data: bytes, random: Random) -> bytes:
    """Move a block of 1 to 4,096 bytes to another place."""
    place, target, size = _place(data, random), _place(data, random), random.choice(_BLOCKS)
    block, rest = data[place : place + size], data[:place] + data[place + size :]
    return rest[:target] + block + rest[target:]


def _clear_block(data: bytes, random: Random) -> bytes:
    """Replace a block of 1 to 4,096 bytes with zeros."""
    place, size = _place(data, random), random.choice(_BLOCKS)
    return data[:place] + bytes(len(data[place : place + size])) + data[place + size :]


def _truncate(data: bytes, random: Random) -> bytes:
    """Remove all bytes from a random place on."""
    return data[: _place(data, random)]


def _set_integer(data: bytes, random: Random) -> bytes:
    """Replace an integer of 2, 4 or 8 bytes with a limit of its type or with a value near the present one.

    Data that are shorter than the integer become longer by one byte.
    """
    code = random.choice(_INTEGERS)
    size = struct.calcsize(code)
    if len(data) < size:
        return data + b"\xff"
    place = min(_place(data, random), len(data) - size)
    (present,) = struct.unpack_from(code, data, place)
    limit = 256**size - 1
    value = random.choice(
        (0, 1, limit, limit // 2, limit // 2 + 1, present + 1, present - 1, present * 2, 1 << 20, 1 << 24)
    )
    return data[:place] + struct.pack(code, value % (limit + 1)) + data[place + size :]


def _insert_fragment(data: bytes, random: Random) -> bytes:
    """Insert a fragment that text readers often mishandle, such as a byte order mark or deep nesting."""
    place = _place(data, random)
    return data[:place] + random.choice(_FRAGMENTS) + data[place:]


def _replace_number(data: bytes, random: Random) -> bytes:
    """Replace a decimal number in a text with an unusual one; insert a fragment if there is no number."""
    match = _NUMBER.search(data, _place(data, random))
    if match is None:
        return _insert_fragment(data, random)
    return data[: match.start()] + random.choice(_NUMBERS) + data[match.end() :]


def _change_line(data: bytes, random: Random) -> bytes:
    """Repeat or remove a line, or exchange two lines."""
    lines = data.split(b"\n")
    place, other = random.randrange(len(lines)), random.randrange(len(lines))
    change = random.randrange(3)
    if change == 0:
        lines.insert(other, lines[place])
    elif change == 1:
        del lines[place]
    else:
        lines[place], lines[other] = lines[other], lines[place]
    return b"\n".join(lines)


OPERATIONS: Final = (
    _flip_bit,
    _set_byte,
    _remove_block,
    _repeat_block,
    _move_block,
    _clear_block,
    _truncate,
    _set_integer,
    _insert_fragment,
    _replace_number,
    _change_line,
)
