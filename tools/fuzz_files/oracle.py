"""The oracle: whether the data of an accepted mutant are a permitted consequence of its mutation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from fuzz_files.document import EMPTY, Flat, is_equal, list_differences
from fuzz_files.target import Rules

_SHOWN: Final = 4
_CHECKED: Final = 40
"""Largest number of changed fields whose values are searched for; a repeated table may change thousands."""


@dataclass(frozen=True)
class Change:
    """The change of a file by a mutation.

    fields: all fields of the mutated file by path; None if the file cannot be decoded, and only rules that need no
    fields are applied. paths: paths of the changed fields. equivalent: those of them whose new text means the same
    number. must_be_refused: whether the file is not a file of its kind. is_reordered: whether only the order of the
    values differs, which many formats ignore. moved: those of the changed fields whose values have only moved between
    elements of a list, which a reader may sort.
    """

    fields: Flat | None = None
    paths: tuple[str, ...] = ()
    equivalent: frozenset[str] = frozenset()
    must_be_refused: bool = False
    is_reordered: bool = False
    moved: frozenset[str] = frozenset()


def find_silent_error(rules: Rules, before: Flat, after: Flat, change: Change) -> str:
    """Return a description of the first silent error: data that do not follow from the changed file.

    before, after: data that the reader has returned for the valid and for the mutated file. Returns "" if there is
    none.
    """
    changed, changes = change.fields, change.paths
    differences = list_differences(before, after)
    if not differences:
        return _find_ignored(rules, change)
    if rules.is_protected:
        return f"the file has a checksum, but the data differ: {_list(differences)}"
    if rules.subset:
        return _find_foreign_elements(rules.subset, before, after)
    if changed is None:
        return ""
    if not changes:
        return f"no field of the file differs, but the data differ: {_list(differences)}"
    unrelated = [path for path in differences if not _is_related(rules, path, changes)]
    if unrelated:
        return f"the changed fields {_list(changes)} have no relation to the different data {_list(unrelated)}"
    new_values = [path for path in changes if path not in change.equivalent | change.moved]
    return _find_misread(rules, after, changed, new_values, differences)


def _find_ignored(rules: Rules, change: Change) -> str:
    """Return a description of the changed fields that the reader accepts without an effect on its data; "" if none."""
    if change.fields is None or change.is_reordered or rules.is_protected or rules.subset:
        return ""
    # Only fields that the changed file still contains are checked. The mutation may remove a field without an effect if
    # its value was the default.
    present = [path for path in change.paths if path in change.fields and path not in change.equivalent]
    present = [path for path in present if not path.endswith("#")]  # "#": the length of a list
    ignored = [path for path in present if not rules.unused.search(path) and not rules.derived.search(path)]
    return f"the changed fields {_list(ignored)} have no effect" if ignored else ""


def _find_foreign_elements(path: str, before: Flat, after: Flat) -> str:
    """Return how many elements of the list at `path` the data of the valid file do not contain, as a text; "" for 0."""
    known, found = before[path], after[path]
    foreign = [element for element in found if element not in known]
    return f"{path}: {len(foreign)} elements that the valid file does not contain" if foreign else ""


def _is_related(rules: Rules, path: str, changes: Sequence[str]) -> bool:
    """Return whether a difference of the data at `path` may follow from one of the changed fields."""
    if not rules.related:
        return True
    return any(field.search(change) and data.search(path) for field, data in rules.related for change in changes)


def _find_misread(rules: Rules, after: Flat, changed: Flat, changes: Sequence[str], differences: Sequence[str]) -> str:
    """Return a description of a changed field whose new value is not among the data that differ; "" if there is none.

    Lengths of lists (paths that end with "#") and fields without an effect of their own are not checked. after: data
    for the mutated file. changed: fields of this file. changes: paths of its changed fields. differences: paths of the
    data that differ.
    """
    values = [after[path] for path in differences if path in after]
    names = "\n".join(differences)  # a name in the file may be a part of a path of the data
    for change in changes[:_CHECKED]:
        if change not in changed or change.endswith("#") or rules.derived.search(change) or rules.unused.search(change):
            continue
        value = changed[change]
        if is_equal(value, EMPTY) or (isinstance(value, np.ndarray) and value.dtype.kind not in "fiub"):
            continue
        if not any(_states(each, value) for each in values) and not (isinstance(value, str) and value in names):
            return f"{change}: the value {ascii(value)[:60]} of the file is not in the data"
    return ""


def _states(value: Any, expected: Any) -> bool:
    """Return whether a value of the data is the value of the file.

    A string in the file may be a number in the data, and an array may contain the value.
    """
    if isinstance(expected, np.ndarray) and expected.ndim == 0:
        expected = expected.item()
    if is_equal(value, expected):
        return True
    if isinstance(value, np.ndarray):
        return bool(value.size) and _is_in(value, expected)
    number = _to_number(expected)
    return number is not None and _to_number(value) == number


def _is_in(array: Any, expected: Any) -> bool:
    """Return whether an array contains a number or a string; a missing value in the file may be NaN in the array."""
    if array.dtype.kind == "U":
        return bool(np.any((array == str(expected)) | (array == str(expected).strip())))
    if array.dtype.kind not in "iufb":
        return False
    if expected is None or str(expected).strip().lower() in ("", "nan"):
        return bool(np.isnan(array).any()) if array.dtype.kind == "f" else False
    number = float(expected) if isinstance(expected, bool) else _to_number(expected)
    return number is not None and bool(np.any(array == number))


def _to_number(value: Any) -> float | None:
    """Convert a number, or a string with a number, to a float; None for other values and for NaN."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    return None if math.isnan(number) else number


def _list(paths: Sequence[str]) -> str:
    """Return the first four paths as a text."""
    return ", ".join(paths[:_SHOWN]) + (", ..." if len(paths) > _SHOWN else "")
