"""The contact filter of the thesis: cones on the taxels, contact points, and a threshold on the distance to a taxel."""

import numpy as np
import pytest

from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.hand import load_hand
from taxel.hand.kinematics import compute_taxel_positions
from taxel.sim.cone_sensing import (
    CONTACT_OFFSET_M,
    NOMINAL_FORCE_N,
    ConeSensing,
    assign_nominal_force,
    compute_base_radius,
)
from taxel.sim.sensor_model import SimSensor

HAND = load_hand("allegro")
PALM = HAND.get_slice(HAND.find_board("palm").address)
PALM_TAXELS = PALM.stop - PALM.start
SLAB = ConvexPolytope.box(0.4, 0.4, 0.1)
IDENTITY = np.eye(4)[None]


def place_palm_above(gap, shape=SLAB):
    """Return board poses f64[1, s, 4, 4]: cones of the palm `gap` metres above a shape, all other boards far away."""
    poses = np.tile(np.eye(4), (1, len(HAND.boards), 1, 1))
    poses[..., :3, 3] = [0, 0, 5.0]
    palm = [board.name for board in HAND.boards].index("palm")
    poses[0, palm] = np.diag([1.0, -1.0, -1.0, 1.0])
    poses[0, palm, :3, 3] = [0, 0, shape.height + 0.001 + gap]
    return poses


def test_the_base_radius_of_a_cone_is_half_the_diagonal_of_a_3_mm_electrode_plus_whole_pitches():
    assert compute_base_radius(HAND) == pytest.approx(2.12e-3, abs=5e-6)
    assert compute_base_radius(HAND, pitches=1) == pytest.approx(2.12e-3 + HAND.pitch_m, abs=5e-6)


def test_the_threshold_of_a_1_mm_high_cone_is_the_distance_from_its_tip_to_the_rim_of_its_base():
    for pitches, threshold_m in ((0, 2.35e-3), (1, 7.19e-3)):
        cones = ConeSensing(compute_base_radius(HAND, pitches), cone_height_m=0.001)
        assert cones.threshold_m == pytest.approx(threshold_m, abs=5e-6)


@pytest.mark.parametrize(
    ("gap_m", "contact_offset_m", "touches"),
    # With a negative offset, cones touch only after a compression: here by 0.2 mm, and they are compressed by 0.1 mm.
    [(1e-4, 2e-4, True), (3e-4, 2e-4, False), (-1e-4, -2e-4, False)],
)
def test_the_cones_of_the_palm_touch_an_object_only_within_the_contact_offset(gap_m, contact_offset_m, touches):
    cones = ConeSensing(compute_base_radius(HAND), contact_offset_m=contact_offset_m)
    is_touching = cones.find_touching_tips(HAND, SLAB, place_palm_above(gap_m), IDENTITY)
    assert is_touching[0, PALM].all() == touches
    assert is_touching.sum() == touches * PALM_TAXELS


def test_an_upright_rod_activates_the_taxels_above_its_end_and_wide_cones_also_their_neighbours():
    """The tips of the cones above the rod touch its end, also up to the contact offset (0.2 mm) beside the rod.

    Narrow cones activate only the taxels with a touching tip. Wide cones, whose base radius is one pitch larger, also
    activate each taxel whose centre is nearer to a touching tip than the rim of a base is. Every tip has the same
    height above the plane of the taxels, so the horizontal distance to the tip is then less than the base radius.
    """
    rod_radius_m, wide_radius_m = 0.004, compute_base_radius(HAND, pitches=1)
    rod = Cylinder(rod_radius_m, 0.1)
    poses = place_palm_above(0.0, rod)
    narrow = ConeSensing(compute_base_radius(HAND)).find_active(HAND, rod, poses, IDENTITY)[0]
    wide = ConeSensing(wide_radius_m).find_active(HAND, rod, poses, IDENTITY)[0]
    centres = compute_taxel_positions(HAND, poses)[0]
    np.testing.assert_array_equal(narrow[PALM], np.hypot(*centres[PALM, :2].T) <= rod_radius_m + CONTACT_OFFSET_M)
    distance = np.linalg.norm(centres[:, None, :2] - centres[None, narrow, :2], axis=2).min(axis=1)
    np.testing.assert_array_equal(wide[PALM], distance[PALM] < wide_radius_m)
    assert 0 < narrow.sum() < wide.sum() < PALM_TAXELS


def test_a_contact_point_of_the_physics_engine_activates_the_nearest_taxel():
    poses = place_palm_above(0.02)
    taxel = PALM.start + 60  # near the middle of the palm
    centre = compute_taxel_positions(HAND, poses)[0, taxel]
    cones = ConeSensing(compute_base_radius(HAND))
    assert not cones.find_active(HAND, SLAB, poses, IDENTITY).any()
    points = (np.array([0]), centre[None] - [0, 0, 0.001])
    assert np.flatnonzero(cones.find_active(HAND, SLAB, poses, IDENTITY, points)).tolist() == [taxel]


def test_frames_are_evaluated_independently():
    poses = np.concatenate([place_palm_above(0.0), place_palm_above(0.01), place_palm_above(0.0)])
    active = ConeSensing(compute_base_radius(HAND)).find_active(HAND, SLAB, poses, np.tile(np.eye(4), (3, 1, 1)))
    assert active.sum(axis=1).tolist() == [PALM_TAXELS, 0, PALM_TAXELS]


def test_the_nominal_force_of_an_active_taxel_exceeds_twice_the_activation_threshold():
    force = assign_nominal_force(np.array([[True, False]]))
    assert force.tolist() == [[NOMINAL_FORCE_N, 0.0]]
    activation_threshold_counts = 150
    assert SimSensor().predict_signal(force)[0, 0] > 2 * activation_threshold_counts
