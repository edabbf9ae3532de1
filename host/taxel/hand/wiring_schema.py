"""Checks of the table [wiring] of a hand description."""

import math
from collections.abc import Mapping
from typing import Any, Final, NotRequired, TypedDict

from taxel.hand.checks import check_identifier, check_table, suggest_name
from taxel.hand.errors import Field, format_value

MAX_BRANCHES: Final = 16
"""Largest number of branches: WIRING_BRANCHES_MAX of the emulator."""

_WIRING: Mapping[str, type] = {"kind": str, "hub_pullup_ohm": float, "hub_capacitance_pf": float, "branches": dict}
_BRANCH: Mapping[str, type] = {"pullup_ohm": float, "capacitance_pf": float, "series_ohm": float}
_RANGES: Mapping[str, tuple[float, float]] = {
    "hub_pullup_ohm": (0.0, 1e6),
    "hub_capacitance_pf": (0.1, 1e5),
    "pullup_ohm": (0.0, 1e6),
    "capacitance_pf": (0.1, 1e5),
    "series_ohm": (0.0, 1e6),
}
_MIN_PULLUP_OHM: Final = 100.0
"""Smallest pull-up resistance that the emulator accepts, ohms."""


class BranchTable(TypedDict):
    """``[wiring.branches.<name>]``: values of each line of a branch."""

    pullup_ohm: NotRequired[float]
    capacitance_pf: NotRequired[float]
    series_ohm: NotRequired[float]


class WiringTable(TypedDict):
    """``[wiring]``: the star of branches; missing values are assumed (`taxel.hand.wiring`)."""

    kind: NotRequired[str]
    hub_pullup_ohm: NotRequired[float]
    hub_capacitance_pf: NotRequired[float]
    branches: NotRequired[dict[str, BranchTable]]


def check_wiring(document: Mapping[str, Any], top: Field) -> None:
    """Check the table [wiring] of a hand description, and the number of branches that the boards name.

    Raises HandDescriptionError for the first error.
    """
    used = sorted({board["branch"] for board in document["boards"] if "branch" in board})
    if len(used) > MAX_BRANCHES:
        top.key("boards").fail(f"at most {MAX_BRANCHES} branches", str(len(used)), "give more boards the same branch")
    if "wiring" not in document:
        return
    field = top.key("wiring")
    table = document["wiring"]
    check_table(table, {}, field, _WIRING)
    if table.get("kind", "passive") not in ("passive", "buffered"):
        field.key("kind").fail('"passive" or "buffered"', format_value(table["kind"]), "correct the kind of the star")
    _check_numbers(table, field)
    for name, branch in table.get("branches", {}).items():
        branch_field = field.key("branches").key(name)
        check_identifier(name, branch_field)
        check_table(branch, {}, branch_field, _BRANCH)
        _check_numbers(branch, branch_field)
        if name not in used:
            remedy = suggest_name(name, used) if used else 'add branch = "..." to the boards'
            branch_field.fail("the branch of a board", "no board with this branch", remedy)


def _check_numbers(table: Mapping[str, Any], field: Field) -> None:
    """Raise HandDescriptionError for an electrical value of a table that is outside its range in `_RANGES`."""
    for key, (low, high) in _RANGES.items():
        value = table.get(key, high)  # a missing value gets a default later; the largest one passes this check
        is_tiny_pullup = key.endswith("pullup_ohm") and 0 < value < _MIN_PULLUP_OHM
        if not (math.isfinite(value) and low <= value <= high) or is_tiny_pullup:
            expected = f"a number from {low:g} to {high:g}"
            if key.endswith("pullup_ohm"):
                expected = f"0 (no resistor), or a number from {_MIN_PULLUP_OHM:g} to {high:g}"
            field.key(key).fail(expected, format_value(value), "write ohms or picofarads")
