"""tools/boards/detection.py, shortened: one fault of each family on a small board, and several healthy boards."""

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
"""Seed of all boards of this file."""
HEALTHY = 2
FAMILIES = 16
POLL_S = 0.05
"""Interval between reads of the link, the largest that these tests permit; saves a third of the computing time."""


@pytest.fixture(scope="module")
def tool():
    """Modules of the campaign, limited to one kind of board."""
    sys.path.insert(0, str(FOLDER))
    modules = SimpleNamespace(**{name: importlib.import_module(name) for name in NAMES})
    modules.board_faults.POLL_S = POLL_S
    boards = modules.board_faults.BOARDS
    all_boards = dict(boards)
    for kind in set(boards) - {SMALL}:
        del boards[kind]
    yield modules
    boards |= all_boards
    for name in NAMES:
        del sys.modules[name]
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


def sample_severity(number):
    """Sample a severity from 1.5 to 10, uniformly distributed on a logarithmic scale."""
    return 1.5 * (10.0 / 1.5) ** random.Random(f"{SEED} {number}").random()


@pytest.mark.parametrize("number", range(FAMILIES))
def test_a_single_fault_is_caught_and_named_at_its_place(tool, number):
    families = tool.board_faults.FAMILIES
    assert len(families) == FAMILIES
    case = tool.board_faults.sample_case(
        families[number], number, SEED, sample_severity(number), tool.detection.load_default_plan()
    )
    print(f"seed {SEED}: {case}")
    result = tool.detection.run_case(case)
    assert (result.caught, result.named, result.others) == (True, True, ())
    assert result.automatic_s < 20.0


@pytest.mark.parametrize("number", range(HEALTHY))
def test_a_healthy_board_is_not_refused(tool, number):
    case = tool.board_faults.sample_case(None, number, SEED, 0.0, tool.detection.load_default_plan())
    print(f"seed {SEED}: {case}")
    result = tool.detection.run_case(case)
    assert (result.caught, result.others) == (False, ())


def test_cases_are_deterministic_and_cover_all_families(tool, monkeypatch):
    """Arguments of `sample_cases`: number of faulty boards, number of healthy boards, number of weaker faults for each
    graded family and each severity of `CURVE_SEVERITIES`, seed.
    """
    fast_families = [family for family in tool.board_faults.FAMILIES if not family.name.startswith("drift")]
    monkeypatch.setattr(tool.detection, "FAMILIES", fast_families)
    cases = tool.detection.sample_cases(2 * len(fast_families), 5, 1, SEED)
    assert cases == tool.detection.sample_cases(2 * len(fast_families), 5, 1, SEED)
    assert {case.family for case in cases} == {family.name for family in fast_families} | {"healthy"}
    # The first 5 cases are healthy boards, then follow two faults of each family. The weaker faults are the last cases.
    assert all(1.5 <= case.severity <= 10.0 for case in cases[5 : 5 + 2 * len(fast_families)])
