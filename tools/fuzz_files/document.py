"""Documents: the content of a file, or the data that a reader returns, as a tree, and as values by path."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from enum import Enum
from pathlib import PurePath
from typing import Any, Final

import numpy as np

Flat = dict[str, Any]
"""Values by path, such as `boards[3].address`. A value is a scalar, a text, bytes, None or an array."""

_SCALARS: Final = (bool, int, float, str, bytes, type(None), np.ndarray)
EMPTY: Final = "(empty)"
"""Value that stands for an empty table."""


def flatten(value: Any, path: str = "", skip: tuple[str, ...] = ()) -> Flat:
    """Return the leaves (values without members) of nested dicts, lists and dataclasses, by path.

    skip: names of fields that are omitted. The length of a list has its path followed by "#".
    """
    result: Flat = {}
    _collect(value, path, skip, result)
    return result


def _collect(value: Any, path: str, skip: tuple[str, ...], result: Flat) -> None:
    """Add the leaves of `value`, whose path is `path`, to `result`."""
    if isinstance(value, Enum):
        result[path] = str(value.value)
    elif isinstance(value, np.generic):
        result[path] = value.item()
    elif isinstance(value, _SCALARS):
        result[path] = value
    elif isinstance(value, Mapping):
        _collect_members({str(key): each for key, each in value.items()}, path, skip, result)
    elif dataclasses.is_dataclass(value):
        members = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        _collect_members(members, path, skip, result)
    elif isinstance(value, list | tuple):
        result[f"{path}#"] = len(value)
        for index, each in enumerate(value):
            _collect(each, f"{path}[{index}]", skip, result)
    elif isinstance(value, frozenset | set):
        _collect(sorted(value, key=repr), path, skip, result)
    elif isinstance(value, PurePath):
        result[path] = value.name
    elif hasattr(value, "isoformat"):
        result[path] = value.isoformat()
    elif hasattr(value, "__dict__"):
        _collect_members(vars(value), path, skip, result)
    else:
        result[path] = repr(value)


def _collect_members(members: Mapping[str, Any], path: str, skip: tuple[str, ...], result: Flat) -> None:
    """Add the leaves of named members to `result`; `EMPTY` if there are no members."""
    if not members:
        result[path] = EMPTY
    for name, each in members.items():
        if name not in skip:
            _collect(each, f"{path}.{name}" if path else name, skip, result)


def list_differences(before: Flat, after: Flat) -> list[str]:
    """Return the paths whose values differ between two documents, or that only one of the two contains."""
    paths = [path for path in before if path not in after or not is_equal(before[path], after[path])]
    return paths + [path for path in after if path not in before]


def is_equal(a: Any, b: Any) -> bool:
    """Return whether two leaves are equal: numbers by value, NaN equals NaN, and a bool equals no number."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return _is_equal_array(a, b)
    if isinstance(a, bool) != isinstance(b, bool):
        return False
    if isinstance(a, float) and isinstance(b, float) and math.isnan(a) and math.isnan(b):
        return True
    return bool(a == b)


def _is_equal_array(a: Any, b: Any) -> bool:
    """Return whether two values are arrays with equal shapes and elements.

    The numeric types may differ, except that a complex array equals only a complex one.
    """
    if not (isinstance(a, np.ndarray) and isinstance(b, np.ndarray)) or a.shape != b.shape:
        return False
    if a.dtype.kind != b.dtype.kind and "c" in a.dtype.kind + b.dtype.kind:
        return False
    has_nan = a.dtype.kind in "fc" and b.dtype.kind in "fc"
    return bool(np.array_equal(a, b, equal_nan=has_nan))
