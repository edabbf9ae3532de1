"""Options of the `emulator:` URL for the star wiring, in which each branch is a cable from the hub to some boards."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

from taxel.hand import Hand
from taxel.hand.wiring import Branch, Wiring, add_buffers
from taxel.link import LinkError

_KEYS: Final = {"pullup_ohm": (0.0, 1e6), "capacitance_pf": (0.1, 1e5), "series_ohm": (0.0, 1e6)}


def parse_wiring(url: str, kind: str | None, branches: Sequence[str], hand: Hand) -> Wiring | None:
    """Return the wiring of a hand with the changes that a URL states; None if the URL changes nothing.

    kind: value of the option `wiring`; None if it is missing. branches: values of the option `branch`, "NAME key=value
    ...". Raises `LinkError` for a hand without branches, an unknown branch or key, or a value out of range.
    """
    if kind is None and not branches:
        return None
    if hand.wiring is None:
        raise LinkError(url, f"hand '{hand.name}' has no branches; add the key branch to the boards of its description")
    if kind not in (None, "passive", "buffered"):
        raise LinkError(url, f"option 'wiring' must be passive or buffered, found '{kind}'")
    wiring = add_buffers(hand.wiring) if kind == "buffered" else hand.wiring
    if kind == "passive":
        wiring = replace(wiring, is_buffered=False)
    described = {branch.name: branch for branch in wiring.branches}
    for line in branches:
        name, *settings = line.split() or [""]
        if name not in described:
            known = ", ".join(described)
            raise LinkError(url, f"option 'branch': hand '{hand.name}' has no branch '{name}'; expected one of {known}")
        for setting in settings:
            described[name] = _change_branch(url, described[name], setting)
    return replace(wiring, branches=tuple(described.values()))


def _change_branch(url: str, branch: Branch, setting: str) -> Branch:
    """Return the branch with one value changed. setting: "key=value". Raises `LinkError` for an invalid setting."""
    key, _, text = setting.partition("=")
    if key not in _KEYS:
        raise LinkError(url, f"option 'branch': expected key=value with {', '.join(_KEYS)}, found '{setting}'")
    low, high = _KEYS[key]
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise LinkError(url, f"option 'branch': {key} must be a number from {low:g} to {high:g}, found '{text}'")
    changes: dict[str, Any] = {key: value}
    return replace(branch, **changes)
