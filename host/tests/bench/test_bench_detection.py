"""tools/boards/detection.py in its short form: each family of faults once on a small board, and some healthy boards."""

from __future__ import annotations

import importlib
import random
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "boards"
NAMES = ("board_faults", "detection", "detection_page")
SMALL = "medial_front"
SEED = 20
"""Draws all boards of this file; a failing one names its own seed too."""
HEALTHY = 2
FAMILIES = 16
LOOK_S = 0.05
"""How often a link is looked at: as seldom as these tests bear, which spares a third of their work."""


@pytest.fixture(scope="module")
def tool():
    """The campaign, with one kind of board."""
    sys.path.insert(0, str(FOLDER))
    found = SimpleNamespace(**{name: importlib.import_module(name) for name in NAMES})
    found.board_faults.LOOK_S = LOOK_S
    boards = found.board_faults.BOARDS
    kept = dict(boards)
    for kind in set(boards) - {SMALL}:
        del boards[kind]
    yield found
    boards |= kept
    for name in NAMES:
        del sys.modules[name]
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


def severity(number):
    """From 1.5 to 10, evenly on a logarithmic scale."""
    return 1.5 * (10.0 / 1.5) ** random.Random(f"{SEED} {number}").random()


@pytest.mark.parametrize("number", range(FAMILIES))
def test_a_single_fault_is_caught_and_named_at_its_place(tool, number):
    families = tool.board_faults.FAMILIES
    assert len(families) == FAMILIES
    case = tool.board_faults.draw_case(families[number], number, SEED, severity(number), tool.detection.default_plan())
    print(f"seed {SEED}: {case}")
    result = tool.detection.test(case)
    assert (result.caught, result.named, result.others) == (True, True, ())
    assert result.automatic_s < 20.0


@pytest.mark.parametrize("number", range(HEALTHY))
def test_a_healthy_board_is_not_refused(tool, number):
    case = tool.board_faults.draw_case(None, number, SEED, 0.0, tool.detection.default_plan())
    print(f"seed {SEED}: {case}")
    result = tool.detection.test(case)
    assert (result.caught, result.others) == (False, ())


def test_cases_repeat_with_their_seed_and_cover_all_families(tool, monkeypatch):
    drawn_quickly = [family for family in tool.board_faults.FAMILIES if not family.name.startswith("drift")]
    monkeypatch.setattr(tool.detection, "FAMILIES", drawn_quickly)
    drawn = tool.detection.cases(2 * len(drawn_quickly), 5, 1, SEED)
    assert drawn == tool.detection.cases(2 * len(drawn_quickly), 5, 1, SEED)
    assert {case.family for case in drawn} == {family.name for family in drawn_quickly} | {"healthy"}
    assert all(1.5 <= case.severity <= 10.0 for case in drawn[5 : 5 + 2 * len(drawn_quickly)])
