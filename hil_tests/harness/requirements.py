"""Abilities that a test requires of a rig, read from its marks, and the report for a rig that lacks one."""

from dataclasses import replace
from typing import Any, Final

import pytest

from hil_tests.harness.rig import ABILITIES
from hil_tests.harness.virtual.world import WorldBuild
from taxel.hand import Hand
from taxel.hand.wiring import Wiring
from taxel.hand.world import ScanSettings

NOT_POSSIBLE: Final = "not possible on this rig: it lacks "


def get_required_abilities(item: pytest.Item | pytest.FixtureRequest) -> set[str]:
    """Return the abilities that the marks `needs` of a test name. A mark `world` adds "build"; every test needs "uart".

    Raises `ValueError` for an unknown ability.
    """
    node = item.node if isinstance(item, pytest.FixtureRequest) else item
    abilities = {name for mark in node.iter_markers("needs") for name in mark.args}
    unknown = abilities - ABILITIES.keys()
    if unknown:
        raise ValueError(f"{node.nodeid}: needs {sorted(unknown)[0]!r}; expected some of {', '.join(ABILITIES)}")
    return abilities | ({"build"} if node.get_closest_marker("world") else set()) | {"uart"}


def get_world_build(request: pytest.FixtureRequest, hand: Hand) -> WorldBuild:
    """Describe the emulated world that the marks `world` and `faulty_image` of a test request.

    The mark `world` has these arguments, all optional:
    lines: additional lines of the world file. only: indices of the boards that are present. scan: fields of
    `ScanSettings`. wiring: "buffered" for a buffer in each branch. slow_branch: name of a branch and its additional
    capacitance in picofarads; each branch then also has a buffer. All other arguments are fields of `WorldSettings`.
    In the texts of `lines`, `faults` and `effects`, {0}, {1} ... are the addresses of the boards in the order of the
    hand.
    """
    mark = request.node.get_closest_marker("world")
    settings: dict[str, Any] = dict(mark.kwargs) if mark else {}
    addresses = [f"0x{board.address:02X}" for board in hand.boards]
    for name in ("faults", "effects", "lines"):
        if name in settings:
            settings[name] = [line.format(*addresses) for line in settings[name]]
    if "scan" in settings:
        settings["scan"] = ScanSettings(**settings["scan"])
    wiring, slow_branch = settings.pop("wiring", None), settings.pop("slow_branch", None)
    if wiring or slow_branch:
        settings["wiring"] = _change_wiring(hand, wiring, slow_branch)
    return WorldBuild(
        lines=settings.pop("lines", ()),
        board_indices=settings.pop("only", None),
        settings=settings,
        has_known_counts="counts" in get_required_abilities(request),
        may_fault=request.node.get_closest_marker("faulty_image") is not None,
    )


def _change_wiring(hand: Hand, kind: str | None, slow_branch: tuple[str, float] | None) -> Wiring:
    """Return the wiring of the hand with a buffer and pull-ups of 2200 ohm in each branch.

    slow_branch: name of one branch and its additional capacitance in picofarads; None: no branch is slow.
    """
    assert hand.wiring is not None
    assert kind in (None, "buffered")
    name, picofarad = slow_branch or ("", 0.0)
    branches = [
        replace(branch, pullup_ohm=2200.0, capacitance_pf=branch.capacitance_pf + picofarad * (branch.name == name))
        for branch in hand.wiring.branches
    ]
    return replace(hand.wiring, is_buffered=True, branches=tuple(branches))


def skip_if_not_possible(required: set[str], abilities: set[str]) -> None:
    """Report the test as not possible if the rig lacks a required ability."""
    missing = sorted(required - abilities)
    if missing:
        pytest.skip(NOT_POSSIBLE + ", ".join(ABILITIES[name] for name in missing))


def is_not_possible(report: pytest.TestReport) -> bool:
    """Whether the report is of a test that the rig cannot run."""
    return report.skipped and isinstance(report.longrepr, tuple) and NOT_POSSIBLE in report.longrepr[2]
