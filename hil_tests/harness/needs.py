"""What a test needs of a rig, and what is said where a rig does not have it."""

from typing import Any, Final

import pytest

from hil_tests.harness.rig import ABILITIES
from taxel.hand import Hand

NOT_POSSIBLE: Final = "not possible on this rig: it lacks "


def needs_of(item: pytest.Item | pytest.FixtureRequest) -> set[str]:
    """The abilities that the marks of a test ask for; of a `world` mark: that the rig can be put together anew."""
    node = item.node if isinstance(item, pytest.FixtureRequest) else item
    needs = {name for mark in node.iter_markers("needs") for name in mark.args}
    unknown = needs - ABILITIES.keys()
    if unknown:
        raise ValueError(f"{node.nodeid}: needs {sorted(unknown)[0]!r}; expected some of {', '.join(ABILITIES)}")
    return needs | ({"build"} if node.get_closest_marker("world") else set()) | {"uart"}


def build_of(request: pytest.FixtureRequest, hand: Hand) -> dict[str, Any]:
    """What the marks `world` and `faulty_image` of a test ask for; text in them may speak of a board as {0}, {1} ...
    in the hand's order.
    """
    mark = request.node.get_closest_marker("world")
    wanted = dict(mark.kwargs) if mark else {}
    wanted["may_fault"] = request.node.get_closest_marker("faulty_image") is not None
    addresses = [f"0x{board.address:02X}" for board in hand.boards]
    for name in ("faults", "effects", "lines"):
        wanted[name] = [line.format(*addresses) for line in wanted.get(name, ())]
    return wanted


def skip_what_is_not_possible(needs: set[str], abilities: set[str]) -> None:
    """Report the test as not possible if something is missing."""
    missing = sorted(needs - abilities)
    if missing:
        pytest.skip(NOT_POSSIBLE + ", ".join(ABILITIES[name] for name in missing))


def is_not_possible(report: pytest.TestReport) -> bool:
    """Whether a report is of a test that the rig cannot run."""
    return report.skipped and isinstance(report.longrepr, tuple) and NOT_POSSIBLE in report.longrepr[2]
