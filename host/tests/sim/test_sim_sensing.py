"""One simulated grasp of rigid boards, felt at each level of detail, and one with a soft layer."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import MOUNT_STIFFNESS_N_PER_M, make_standing_pose, make_thesis_objects
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.sim.closing import simulate_grasp
from taxel.sim.cone_sensing import NOMINAL_FORCE_N
from taxel.sim.layer import STIFFNESS_N_PER_M
from taxel.sim.scene import build_scene
from taxel.sim.sensing import LEVELS, Sensing, sense
from taxel.sim.separation import MISS_M
from taxel.sim.soft_contact import LayerLaw

HAND = load_hand("allegro")
ITEM = make_thesis_objects()["rectangular_prism"]
LINE = Timeline(baseline_s=0.2, closing_s=2.0, hold_s=0.4, release_s=1.0, recovery_s=0.2)
ROUNDING_N = 1e-6


@cache
def motion():
    approach = next(
        a
        for a in make_thesis_approaches(withdraw_m=0.02)
        if (a.object, a.name) == ("rectangular_prism", "narrow_side_1")
    )
    return simulate_grasp(build_scene(HAND, ITEM, "palm"), approach, LINE, rate_hz=5.0)


@cache
def felt(level, **options):
    return sense(HAND, ITEM.shape, motion(), Sensing(level, **options))


def on_boards(force):
    """Sum of each board's taxel forces along its load, f64[T, s]; 0 for a board without load."""
    vectors = -force[:, :, None] * HAND.normal
    sums = np.stack([vectors[:, HAND.get_slice(board.address)].sum(axis=1) for board in HAND.boards], axis=1)
    directions = motion().wrench[:, :, :3] / np.maximum(loads(), 1e-12)[:, :, None]
    return np.sum(sums * directions, axis=2)


def loads():
    return np.linalg.norm(motion().wrench[:, :, :3], axis=2)


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_gives_finite_forces_that_press(level):
    result = felt(level)
    frames = len(motion().time_s)
    assert result.contact_force.shape == result.separation.shape == (frames, 1073)
    assert np.isfinite(result.contact_force).all()
    assert np.isfinite(result.separation).all()
    assert (result.contact_force >= 0).all()
    assert (result.separation <= MISS_M).all()


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_feels_the_hold_and_nothing_while_the_palm_is_away(level):
    force, phase = felt(level).contact_force, motion().phase
    away = (phase == Phase.BASELINE) | (phase == Phase.RECOVERY)
    assert not force[away].any()
    assert ((force[phase == Phase.HOLD] > 0.05).sum(axis=1) > 5).all()


def test_cones_stand_as_high_as_the_layer_so_that_a_hand_that_touches_is_felt():
    """Cones that end below the surface with which boards touch would hardly ever reach an object."""
    hold = motion().phase == Phase.HOLD
    active, load = felt("cones").contact_force[hold] > 0, loads()[hold]
    flat = HAND.find_board("palm")
    assert (load[:, HAND.boards.index(flat)] > 1.0).all()
    assert active[:, HAND.get_slice(flat.address)].any(axis=1).all()


@pytest.mark.parametrize("level", ["rigid", "coupled"])
def test_a_board_without_load_feels_nothing(level):
    per_board = np.stack([felt(level).contact_force[:, HAND.get_slice(b.address)].sum(axis=1) for b in HAND.boards], 1)
    assert not per_board[loads() == 0].any()


def test_taxels_of_the_layer_bear_at_most_the_boards_load_and_its_bare_margin_the_rest():
    net, load = on_boards(felt("rigid").contact_force), loads()
    assert (net <= load + ROUNDING_N).all()
    hold = motion().phase == Phase.HOLD
    share = net[hold].sum() / load[hold].sum()
    assert 0.5 < share < 1.0


def test_the_whole_load_of_coupled_cells_is_on_taxels():
    net, load = on_boards(felt("coupled").contact_force), loads()
    hold = motion().phase == Phase.HOLD
    assert net[hold].sum() == pytest.approx(load[hold].sum(), rel=0.1)


def test_a_pressed_taxel_of_the_layer_is_where_the_object_is():
    """But at an edge, which springs beside the taxel's centre may touch while its own normal misses the object."""
    result = felt("rigid")
    heavy = result.contact_force > 0.2
    assert heavy.any()
    pressed = heavy & (result.separation < 0)
    assert pressed.sum() > 0.6 * heavy.sum()
    depth = result.contact_force / STIFFNESS_N_PER_M
    assert np.median(np.abs(depth + result.separation)[pressed]) < 1e-4


def test_a_stiffer_layer_spreads_the_same_load_over_fewer_taxels():
    soft, stiff = felt("rigid").contact_force, felt("rigid", stiffness_n_per_m=4 * STIFFNESS_N_PER_M).contact_force
    hold = motion().phase == Phase.HOLD
    assert (stiff[hold] > 0.01).sum() < (soft[hold] > 0.01).sum()
    assert stiff.max() > soft.max()


def test_cones_are_active_or_not_and_wider_ones_activate_at_least_the_same():
    narrow, wide = felt("cones").contact_force, felt("cones", cone_pitches=1.0).contact_force
    assert set(np.unique(wide).tolist()) == {0.0, NOMINAL_FORCE_N}
    assert (wide[narrow > 0] > 0).all()
    assert (wide > 0).sum() > (narrow > 0).sum()


def test_the_layer_is_what_is_used_unless_told_otherwise():
    assert Sensing().level == "layer"
    assert replace(Sensing(), level="cones").level in LEVELS


@cache
def soft_motion():
    approach = next(a for a in make_thesis_approaches(withdraw_m=0.02) if a.name == "narrow_side_1")
    return simulate_grasp(build_scene(HAND, ITEM, "palm"), approach, LINE, rate_hz=5.0, law=LayerLaw())


def test_a_soft_layer_bears_while_the_bodies_move():
    """Its taxels' net force is that of the boards, less what the bare margin bears."""
    motion, hold = soft_motion(), soft_motion().phase == Phase.HOLD
    result = sense(HAND, ITEM.shape, motion, Sensing())
    assert result.contact_force is motion.taxel_force
    net = np.linalg.norm(motion.wrench[hold][:, :, :3], axis=2).sum(axis=1)
    assert (result.contact_force[hold].sum(axis=1) < 1.05 * net).all()
    assert (result.contact_force[hold].sum(axis=1) > 0.4 * net).all()
    palm = HAND.get_slice(HAND.find_board("palm").address)
    pressed = (result.contact_force > 0.1) & (result.separation < 0)
    assert pressed[hold][:, palm].any()
    middle = result.contact_force[hold][:, palm], result.separation[hold][:, palm]
    flat = (middle[0] > 0.1) & (middle[1] < -1e-4)
    expected = LayerLaw().force(-middle[1][flat])
    assert np.median(np.abs(middle[0][flat] / expected - 1.0)) < 0.1


def test_a_soft_layer_ends_where_the_mounts_spring_balances_the_hand():
    motion = soft_motion()
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    yielded = motion.object_pose[end, :3, 3] + motion.object_pose[end, :3, 2] * ITEM.shape.height / 2
    yielded -= make_standing_pose()[:3, 3] + np.array([0.0, 0.0, ITEM.shape.height / 2])
    forces = np.einsum("sij,sj->si", motion.sensor_poses[end, :, :3, :3], motion.wrench[end, :, :3])
    np.testing.assert_allclose(-forces.sum(axis=0), MOUNT_STIFFNESS_N_PER_M * yielded, atol=0.3)


def test_the_curve_of_the_layer_rises_ever_more_steeply_and_its_slope_is_its_derivative():
    depth = np.linspace(1e-5, 1.2e-3, 50)
    law = LayerLaw()
    slope = (law.force(depth + 1e-9) - law.force(depth - 1e-9)) / 2e-9
    np.testing.assert_allclose(law.stiffness(depth), slope, rtol=1e-5)
    assert (np.diff(law.stiffness(depth)) > 0).all()
    assert law.secant(1.0) == pytest.approx(1.0 / np.interp(1.0, law.force(depth), depth), rel=0.01)
