"""Two recorded closings of the original simulator: recovered poses, the original filter, and the level `original`."""

import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT / "tools/original"), str(ROOT / "tools/hand")]
import compare_contacts  # noqa: E402
import recorded_closings  # noqa: E402

DOCUMENT = (ROOT / "docs/original-simulator.md").read_text()


@pytest.fixture(scope="module", params=["cylinder", "box"])
def comparison(request):
    """Compare a recorded closing with simulations: (recovered closing, table rows; the first row is the recording)."""
    return compare_contacts.compare(request.param)


def test_coded_centres_fit_the_kept_taxels_of_the_recorded_closing(comparison):
    """The residual of the fitted posture is below 0.03 mm on every part of the hand, and below 0.001 mm on three parts.

    The recovered height of the palm above the ground is 105 mm, as docs/original-simulator.md states.
    """
    closing, _ = comparison
    residuals_mm = sorted(closing.residual_mm.values())
    palm_height_m = closing.palm_link[2, 3]
    assert palm_height_m == pytest.approx(0.105, abs=1e-6)
    assert residuals_mm[-1] < 0.03
    assert residuals_mm[2] < 0.001


def test_the_original_filter_keeps_as_many_taxels_as_in_the_recording(comparison):
    closing, _ = comparison
    recorded, recomputed = recorded_closings.count_kept(closing)
    assert recorded == recomputed == {"cylinder": 78, "box": 111}[closing.name]


def test_recorded_points_lie_on_the_object_of_the_recovered_pose(comparison):
    _, rows = comparison
    assert rows[0].distance_mm[0] < 0.1
    assert rows[0].distance_mm[2] < 1.7


def test_the_level_original_activates_the_taxels_of_the_recorded_points_where_the_palm_has_tips(comparison):
    """The key "2.34" is the distance threshold in mm of the original filter.

    `active`: number of active taxels. `common`: number of taxels that are active in both recording and simulation.
    """
    closing, (recorded, *simulated) = comparison
    if closing.name == "cylinder":  # without tips of the palm, other taxels of similar number are active
        assert all(row.active["2.34"] == pytest.approx(recorded.active["2.34"], rel=0.15) for row in simulated)
        return
    for row in simulated:
        assert row.common["2.34"] >= 0.85 * recorded.active["2.34"]
        assert row.active["2.34"] == pytest.approx(recorded.active["2.34"], rel=0.1)


def test_the_page_contains_the_numbers_of_the_recorded_points(comparison):
    _, rows = comparison
    assert f"| recorded | {rows[0].points} | {rows[0].distinct} |" in DOCUMENT
    assert f"| {rows[0].active['2.34']} | {rows[0].active['5.12']} |" in DOCUMENT


def test_a_wrong_posture_moves_a_taxel_by_more_than_the_residual_of_the_fit():
    """Joint angles that are wrong by 0.05 rad move a taxel by more than 2 mm, far more than the residual of the fit."""
    closing = recorded_closings.recover("box")
    angles = np.array([closing.angles[f"joint_{4 + i}_0"] for i in range(4)])
    placed = recorded_closings.place_finger(closing.palm_link, "middle", angles)
    moved = recorded_closings.place_finger(closing.palm_link, "middle", angles + 0.05)
    assert np.linalg.norm(placed - moved, axis=1).max() > 0.002
