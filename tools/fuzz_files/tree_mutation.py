"""Mutations of the fields of a document: other values, types and lengths, missing, repeated and nested fields."""

from __future__ import annotations

import copy
import math
from random import Random
from typing import Any, Final

import numpy as np

from fuzz_files.byte_mutation import mutate_bytes

NUMBERS: Final[tuple[int | float, ...]] = (
    0, 1, -1, 2, 127, 128, 255, 256, 65_535, 65_536, 2**31 - 1, 2**31, 2**32, 2**53 + 1, 2**63, 2**64, -(2**63), 10**30,
    10**400, 0.5, -0.0, 1e-320, 1e-30, 1e30, 1e154, 1e308, -1e308, math.nan, math.inf, -math.inf,
)  # fmt: skip
TEXTS: Final = (
    "", " ", "0", "nan", "1e308", "true", "null", "../../etc/passwd", "/dev/zero", "a" * 300, "b" * 100_000, "\0", "\n",
    "é\u202e\U0001f600", "\ud800", "%s%n", "{}", "1_000", "0x10", "１",
)  # fmt: skip
_DEPTHS: Final = (3, 40, 200, 900)
_TYPES: Final = ("f8", "f4", "f2", "i8", "u8", "i4", "u2", "u1", "?", ">f8", "S8", "U8", "c16")
_REPEATS: Final = (1, 2, 30, 2000)

Slot = tuple[Any, Any]
"""A container and the key or index of one of its members."""


def mutate_tree(document: Any, random: Random) -> tuple[Any, str]:
    """Return a copy of a document with one to three random changes, and a description of them.

    The document itself is not changed.
    """
    root = [copy.deepcopy(document)]
    changes = []
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        container, key = _choose_slot(root, random)
        changes.append(_change(container, key, random))
    return root[0], "; ".join(changes)


def _choose_slot(root: list[Any], random: Random) -> Slot:
    """Choose a random member of the document.

    The walk from the root goes down one level at a time, and stops at each level with a probability of 0.1.
    """
    container: Any = root
    key: Any = 0
    while True:
        value = container[key]
        members: Any = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
        if not members or (container is not root and random.random() < 0.1):
            return container, key
        container, key = value, random.choice(members)


def _change(container: Any, key: Any, random: Random) -> str:
    """Change one member of a container in place, and return a description."""
    value = container[key]
    operation = random.random()
    if operation < 0.55 or not isinstance(container, dict | list):
        container[key] = _other_value(value, random)
        return f"{key!r}: {_show(value)} -> {_show(container[key])}"
    if operation < 0.65:
        del container[key]
        return f"{key!r} deleted"
    if operation < 0.75:
        return _repeat(container, key, random)
    if operation < 0.85:
        return _exchange(container, key, random)
    if operation < 0.93:
        nested: Any = value
        depth = random.choice(_DEPTHS)
        for _ in range(depth):
            nested = [nested] if random.random() < 0.5 else {"a": nested}
        container[key] = nested
        return f"{key!r} nested {depth} times"
    return _rename(container, key, random)


def _other_value(value: Any, random: Random) -> Any:
    """Return a replacement for a value, most often of the same type."""
    if random.random() < 0.2:
        return random.choice((None, True, False, [], {}, 0, "text", 1.5, [value], {"a": value}))
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return _other_number(value, random)
    if isinstance(value, str):
        return _other_text(value, random)
    if isinstance(value, bytes):
        return mutate_bytes(value, random)[0]
    if isinstance(value, np.ndarray):
        return _other_array(value, random)
    if isinstance(value, list):
        return value[: random.randrange(len(value) + 1)] if random.random() < 0.5 else random.sample(value, len(value))
    if isinstance(value, dict):
        return {key: value[key] for key in value if random.random() < 0.7}
    return random.choice((*NUMBERS, *TEXTS))


def _other_number(value: int | float, random: Random) -> int | float:
    """Return a number near `value`, or a number at the limit of some type."""
    finite = value if math.isfinite(value) else 0
    near = (
        value + 1,
        value - 1,
        -value,
        finite * 2,
        finite * 10,
        finite / 2 if abs(finite) < 1e300 else 0,
        finite + 0.5,
    )
    return random.choice(near) if random.random() < 0.6 else random.choice(NUMBERS)


def _other_text(value: str, random: Random) -> str:
    """Return a string with one change, or an unusual string."""
    if value and random.random() < 0.5:
        place = random.randrange(len(value))
        return value[:place] + random.choice(("", "x", " ", "0", "\0", "é", value)) + value[place + 1 :]
    return random.choice(TEXTS)


def _other_array(value: np.ndarray, random: Random) -> np.ndarray:
    """Return an array with another element, length, shape or type."""
    choice = random.random()
    if choice < 0.45 and value.size and value.dtype.kind in "fiub":
        changed = value.copy()
        with np.errstate(all="ignore"):
            number = _other_number(value.flat[0].item(), random)
            low, high = (np.iinfo(value.dtype).min, np.iinfo(value.dtype).max) if value.dtype.kind in "iu" else (0, 0)
            is_outside = value.dtype.kind in "iu" and not low <= number <= high
            # number != number: NaN, which no integer type can store.
            if value.dtype.kind == "f":
                number = float(number) if abs(number) < 1e308 or number != number else math.inf
            elif is_outside or number != number:
                number = int(high)
            changed.flat[random.randrange(value.size)] = number
        return changed
    if choice < 0.6 and value.ndim:
        return value[: random.randrange(len(value) + 1)]
    if choice < 0.7 and value.size < 10_000:
        return np.concatenate([np.atleast_1d(value)] * random.choice((2, 3, 20)))
    if choice < 0.8:
        return value.T if value.ndim > 1 else value[None]
    if value.dtype.kind in "fiub":
        with np.errstate(all="ignore"):
            return value.astype(
                random.choice(("f8", "f4", "f2", "i8", "u8", "i4", "u2", "u1", "?", ">f8", "S8", "U8", "c16"))
            )
    return np.zeros(value.shape)


def _repeat(container: Any, key: Any, random: Random) -> str:
    """Repeat a member in place: in a list as further elements, in a dict under a new key. Returns a description."""
    count = random.choice(_REPEATS)
    if isinstance(container, list):
        limit = 2000 if isinstance(container[key], int | float | str) else 200
        container[key:key] = [copy.deepcopy(container[key]) for _ in range(min(count, limit))]
    else:
        container[f"{key}2"] = copy.deepcopy(container[key])
    return f"{key!r} repeated"


def _exchange(container: Any, key: Any, random: Random) -> str:
    """Exchange the values of two members of a container in place, and return a description."""
    other = random.choice(list(container) if isinstance(container, dict) else range(len(container)))
    container[key], container[other] = container[other], container[key]
    return f"{key!r} exchanged with {other!r}"


def _rename(container: Any, key: Any, random: Random) -> str:
    """Give a member of a dict another key; replace a member of a list by a list of two copies.

    Returns a description.
    """
    if isinstance(container, dict):
        name = random.choice((f"{key}x", str(key)[:-1], str(key).upper(), "", "name", "a.b", "__class__"))
        container[name] = container.pop(key)
        return f"{key!r} renamed to {name!r}"
    container[key] = [container[key], container[key]]
    return f"{key!r} doubled"


def _show(value: Any) -> str:
    """Return a short text for a value, for the description of a mutation."""
    if isinstance(value, np.ndarray):
        return f"array {value.dtype} {list(value.shape)}"
    if isinstance(value, int) and abs(value) > 10**40:  # 10**400 of `NUMBERS`
        return "an integer of hundreds of digits"
    text = ascii(value) if isinstance(value, int | float | str | bytes | type(None)) else type(value).__name__
    return text if len(text) < 40 else text[:40] + "..."
