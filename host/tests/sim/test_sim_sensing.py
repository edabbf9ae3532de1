"""Taxel forces of one simulated grasp with each contact model ("level"), and of a grasp with a soft layer."""

from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import ASSUMED_SIZES, make_thesis_objects
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.sim.closing import SimulationSettings, simulate_grasp
from taxel.sim.cone_sensing import NOMINAL_FORCE_N
from taxel.sim.layer import STIFFNESS_N_PER_M
from taxel.sim.scene import build_scene
from taxel.sim.sensing import LEVELS, Sensing, sense
from taxel.sim.separation import MISS_M
from taxel.sim.soft_contact import LayerLaw

HAND = load_hand("allegro")
OBJECT = make_thesis_objects(ASSUMED_SIZES)["rectangular_prism"]
TIMELINE = Timeline(baseline_s=0.2, closing_s=3.0, hold_s=0.4, release_s=1.0, recovery_s=0.2)
ROUNDING_N = 1e-6


@cache
def simulate_rigid_grasp():
    """Simulate a grasp of the rectangular prism with rigid boards, five samples per second."""
    approach = next(
        a
        for a in make_thesis_approaches(withdraw_m=0.02)
        if (a.object, a.name) == ("rectangular_prism", "narrow_side_1")
    )
    return simulate_grasp(build_scene(HAND, OBJECT, "palm"), approach, TIMELINE, SimulationSettings(rate_hz=5.0))


@cache
def sense_grasp(level, **options):
    """Compute taxel forces and separations of the rigid grasp with a contact model."""
    return sense(HAND, OBJECT.shape, simulate_rigid_grasp(), Sensing(level, **options))


def sum_board_forces(force):
    """Sum the taxel forces of each board along the force on the board, f64[T, s], in N; 0 for a board without load."""
    vectors = -force[:, :, None] * HAND.normal
    sums = np.stack([vectors[:, HAND.get_slice(board.address)].sum(axis=1) for board in HAND.boards], axis=1)
    directions = simulate_rigid_grasp().wrench[:, :, :3] / np.maximum(compute_board_loads(), 1e-12)[:, :, None]
    return np.sum(sums * directions, axis=2)


def compute_board_loads():
    """Return the force in N on each board of the rigid grasp, f64[T, s]."""
    return np.linalg.norm(simulate_rigid_grasp().wrench[:, :, :3], axis=2)


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_gives_finite_non_negative_forces(level):
    result = sense_grasp(level)
    frames = len(simulate_rigid_grasp().time_s)
    assert result.contact_force.shape == result.separation.shape == (frames, HAND.n_taxels)
    assert np.isfinite(result.contact_force).all()
    assert np.isfinite(result.separation).all()
    assert (result.contact_force >= 0).all()
    assert (result.separation <= MISS_M).all()


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_has_loaded_taxels_in_hold_and_none_while_the_palm_is_withdrawn(level):
    force, phase = sense_grasp(level).contact_force, simulate_rigid_grasp().phase
    is_withdrawn = (phase == Phase.BASELINE) | (phase == Phase.RECOVERY)
    assert not force[is_withdrawn].any()
    assert ((force[phase == Phase.HOLD] > 0.05).sum(axis=1) > 5).all()


def test_cones_are_active_on_a_board_with_load():
    """The tips of the cones are at the surface of the layer; shorter cones would miss most objects."""
    hold = simulate_rigid_grasp().phase == Phase.HOLD
    active, load = sense_grasp("cones").contact_force[hold] > 0, compute_board_loads()[hold]
    palm = HAND.find_board("palm")
    assert (load[:, HAND.boards.index(palm)] > 1.0).all()
    assert active[:, HAND.get_slice(palm.address)].any(axis=1).all()


@pytest.mark.parametrize("level", ["rigid", "coupled"])
def test_a_board_without_load_has_no_taxel_forces(level):
    per_board = np.stack(
        [sense_grasp(level).contact_force[:, HAND.get_slice(b.address)].sum(axis=1) for b in HAND.boards], 1
    )
    assert not per_board[compute_board_loads() == 0].any()


def test_rigid_taxel_forces_sum_to_half_or_more_but_not_all_of_the_board_load():
    """Level "rigid" balances the load with springs at the taxels only; where no taxel can carry it, load is missing."""
    net, load = sum_board_forces(sense_grasp("rigid").contact_force), compute_board_loads()
    assert (net <= load + ROUNDING_N).all()
    hold = simulate_rigid_grasp().phase == Phase.HOLD
    share = net[hold].sum() / load[hold].sum()
    assert 0.5 < share < 1.0


def test_coupled_taxel_forces_sum_to_the_board_load():
    net, load = sum_board_forces(sense_grasp("coupled").contact_force), compute_board_loads()
    hold = simulate_rigid_grasp().phase == Phase.HOLD
    assert net[hold].sum() == pytest.approx(load[hold].sum(), rel=0.1)


def test_loaded_taxels_penetrate_the_object_by_force_over_stiffness():
    """The bounds allow for edges, where the normal of a loaded taxel can miss the object."""
    result = sense_grasp("rigid")
    is_loaded = result.contact_force > 0.2
    assert is_loaded.any()
    is_penetrating = is_loaded & (result.separation < 0)
    assert is_penetrating.sum() > 0.6 * is_loaded.sum()
    depth = result.contact_force / STIFFNESS_N_PER_M
    assert np.median(np.abs(depth + result.separation)[is_penetrating]) < 1e-4


def test_a_stiffer_layer_spreads_the_same_load_over_fewer_taxels():
    soft, stiff = (
        sense_grasp("rigid").contact_force,
        sense_grasp("rigid", stiffness_n_per_m=4 * STIFFNESS_N_PER_M).contact_force,
    )
    hold = simulate_rigid_grasp().phase == Phase.HOLD
    assert (stiff[hold] > 0.01).sum() < (soft[hold] > 0.01).sum()
    assert stiff.max() > soft.max()


def test_cone_forces_are_binary_and_wider_cones_activate_a_superset():
    narrow, wide = sense_grasp("cones").contact_force, sense_grasp("cones", cone_pitches=1.0).contact_force
    assert set(np.unique(wide).tolist()) == {0.0, NOMINAL_FORCE_N}
    assert (wide[narrow > 0] > 0).all()
    assert (wide > 0).sum() > (narrow > 0).sum()


def test_the_default_level_is_layer():
    assert Sensing().level == "layer"


@cache
def simulate_soft_grasp():
    """Simulate a grasp of the rectangular prism with a soft layer, five samples per second."""
    approach = next(a for a in make_thesis_approaches(withdraw_m=0.02) if a.name == "narrow_side_1")
    return simulate_grasp(
        build_scene(HAND, OBJECT, "palm"), approach, TIMELINE, SimulationSettings(rate_hz=5.0, law=LayerLaw())
    )


def test_taxel_forces_of_a_soft_layer_agree_with_its_law_and_the_board_wrenches():
    """The margin without taxels carries the remainder of the board wrench."""
    soft_grasp, hold = simulate_soft_grasp(), simulate_soft_grasp().phase == Phase.HOLD
    result = sense(HAND, OBJECT.shape, soft_grasp, Sensing())
    assert result.contact_force is soft_grasp.taxel_force
    board_load = np.linalg.norm(soft_grasp.wrench[hold][:, :, :3], axis=2).sum(axis=1)
    assert (result.contact_force[hold].sum(axis=1) < 1.05 * board_load).all()
    assert (result.contact_force[hold].sum(axis=1) > 0.4 * board_load).all()
    palm = HAND.get_slice(HAND.find_board("palm").address)
    is_loaded = (result.contact_force > 0.1) & (result.separation < 0)
    assert is_loaded[hold][:, palm].any()
    palm_force, palm_separation = result.contact_force[hold][:, palm], result.separation[hold][:, palm]
    is_penetrating = (palm_force > 0.1) & (palm_separation < -1e-4)
    expected = LayerLaw().compute_force(-palm_separation[is_penetrating])
    assert np.median(np.abs(palm_force[is_penetrating] / expected - 1.0)) < 0.1


def test_the_stiffness_of_the_layer_law_is_the_derivative_of_the_force_and_increases():
    depth = np.linspace(1e-5, 1.2e-3, 50)
    law = LayerLaw()
    slope = (law.compute_force(depth + 1e-9) - law.compute_force(depth - 1e-9)) / 2e-9
    np.testing.assert_allclose(law.compute_stiffness(depth), slope, rtol=1e-5)
    assert (np.diff(law.compute_stiffness(depth)) > 0).all()
