"""The soft layer spreads a board's wrench over its taxels so that force and moments are those that were given."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.hand import load_hand
from taxel.hand.description import Board, BoardKind, Hand
from taxel.hand.geometry import Surface
from taxel.hand.transforms import apply, from_rotation_vector, rotate
from taxel.sim.coupled_layer import press_coupled_layer
from taxel.sim.layer import MAX_TILT_RAD, STIFFNESS_N_PER_M, press_layer
from taxel.sim.separation import MISS_M, LayerThicknessError, distances, separations

PITCH, LAYER, K = 0.005, 0.001, STIFFNESS_N_PER_M
PLANE = ConvexPolytope.box(0.4, 0.4, 0.4)
ROD = Cylinder(0.03, 0.4)


def hand_of(position, normal, tx=5, rx=5):
    distal = np.tile([1.0, 0.0, 0.0], (len(position), 1))
    kind = BoardKind("test", 1, np.ones((tx, rx), dtype=bool), Surface(position, normal, distal))
    board = Board("test", kind, 0x20, "link", np.eye(4))
    return Hand("test", "one board", PITCH, 0.003, (board,), layer_m=LAYER)


def flat_grid():
    steps = (np.arange(5) - 2) * PITCH
    return np.stack([*np.meshgrid(steps, steps, indexing="ij"), np.zeros((5, 5))], axis=-1).reshape(-1, 3)


def flat_hand():
    return hand_of(flat_grid(), np.tile([0.0, 0.0, 1.0], (25, 1)))


def curved_hand(radius=0.02):
    """A board bent about y, as a fingertip."""
    grid = flat_grid()
    angle = grid[:, 0] / radius
    normal = np.stack([np.sin(angle), np.zeros(25), np.cos(angle)], axis=1)
    return hand_of(np.array([0, 1, 0]) * grid + radius * (normal - [0, 0, 1]), normal)


def above_top(gap, turn=(0.0, 0.0, 0.0)):
    """Poses of a board whose skin looks down on the top of the box, `gap` above it."""
    pose = from_rotation_vector(np.array(turn)) @ from_rotation_vector(np.array([np.pi, 0, 0]))
    pose[:3, 3] = [0, 0, PLANE.height + LAYER + gap]
    return pose[None, None]


def beside_rod(gap=0.0):
    """A flat board whose x axis lies across a rod's axis, whose y axis is along it."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    pose[:3, 3] = [ROD.radius + LAYER + gap, 0, 0.2]
    return pose[None, None]


def push(force, at=(0.0, 0.0), axis=(0.0, 0.0, -1.0)):
    """Wrench of a force along an axis through a point (x, y) of the board."""
    vector = force * np.array(axis)
    return np.concatenate([vector, np.cross([*at, 0.0], vector)])[None, None]


def pressed(hand, shape, poses, wrench, **options):
    return press_layer(hand, shape, poses, np.eye(4)[None], wrench, **options)


def wrench_of(hand, force):
    """Net force and moment on the first board in its own frame."""
    vectors = -force[:, None] * hand.normal
    at = hand.position + LAYER * hand.normal
    return np.concatenate([vectors.sum(axis=0), np.cross(at, vectors).sum(axis=0)])


def test_a_centred_force_on_a_plane_is_shared_alike():
    result = pressed(flat_hand(), PLANE, above_top(0.0003), push(5.0))
    np.testing.assert_allclose(result.contact_force, 0.2, rtol=1e-12)
    np.testing.assert_allclose(result.separation, -0.2 / K, rtol=1e-12)
    np.testing.assert_allclose(result.approach_m, 0.0003 + 0.2 / K, rtol=1e-9)
    np.testing.assert_allclose(result.tilt_rad, 0.0, atol=1e-12)


def test_an_off_centre_force_is_spread_linearly():
    hand, at = flat_hand(), (0.002, -0.001)
    result = pressed(hand, PLANE, above_top(0.0), push(5.0, at))
    second_moment = np.sum(hand.position[:, 0] ** 2)
    expected = 5.0 * (1 / 25 + (hand.position[:, :2] @ at) / second_moment)
    assert expected.min() > 0
    # Exact but for the cosine of the tilt.
    np.testing.assert_allclose(result.contact_force[0], expected, rtol=1e-3)
    np.testing.assert_allclose(wrench_of(hand, result.contact_force[0]), push(5.0, at)[0, 0], atol=5e-9)


def test_a_board_is_pressed_hardest_under_a_rod_and_as_a_parabola_across():
    hand = flat_hand()
    result = pressed(hand, ROD, beside_rod(), push(8.0))
    force = result.contact_force[0].reshape(5, 5)
    np.testing.assert_allclose(force, force[:, :1] * np.ones(5), atol=1e-9)
    np.testing.assert_allclose(force, force[::-1], atol=1e-9)
    x = hand.position.reshape(5, 5, 3)[:, 0, 0]
    depth = force[2, 0] / K - (ROD.radius - np.sqrt(ROD.radius**2 - x**2))
    np.testing.assert_allclose(force[:, 0], K * np.maximum(depth, 0), atol=1e-6)
    assert force.sum() == pytest.approx(8.0, rel=1e-12)


@pytest.mark.parametrize("at", [(0.0, 0.0), (0.0015, 0.0), (0.001, -0.0015)])
def test_a_curved_tip_on_a_plane_bears_the_load_where_it_is(at):
    hand = curved_hand()
    result = pressed(hand, PLANE, above_top(0.0), push(4.0, at))
    net = wrench_of(hand, result.contact_force[0])
    assert net[2] == pytest.approx(-4.0, rel=1e-12)
    assert result.moment_residual_nm[0, 0] < 4e-9 * 0.005
    # About the point level with the taxels the lateral parts of curved taxels' forces have no arm to speak of.
    np.testing.assert_allclose([-net[4] / net[2], net[3] / net[2]], at, atol=5e-4)
    assert 0 < (result.contact_force > 0).sum() < 25


def test_force_and_separation_are_one_law_for_every_taxel():
    hand = load_hand("allegro")
    poses, objects, wrench = press_of_every_board(hand, 5)
    result = press_layer(hand, ROD, poses, objects, wrench)
    assert (result.contact_force > 0).any(axis=1).all()
    np.testing.assert_allclose(result.contact_force, K * np.maximum(-result.separation, 0), atol=1e-12)


def press_of_every_board(hand, seed, frames=6):
    """Boards laid against a rod with a random taxel foremost, and the wrench of an even load of the nearest taxels."""
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (frames, len(hand.boards), 1, 1))
    wrench = np.zeros((frames, len(hand.boards), 6))
    for frame in range(frames):
        for index, board in enumerate(hand.boards):
            own = hand.get_slice(board.address)
            surface, normal = hand.position[own] + hand.layer_m * hand.normal[own], hand.normal[own]
            middle = rng.integers(len(surface))
            inward = np.array([-1.0, 0.0, 0.0])
            half = normal[middle] + inward
            axis = half / np.linalg.norm(half) if np.linalg.norm(half) > 1e-6 else np.array([0.0, 1.0, 0.0])
            pose = from_rotation_vector(np.pi * axis) @ np.eye(4)  # half a turn about the bisector swaps the two
            pose = from_rotation_vector(rng.uniform(-0.03, 0.03, 3)) @ pose
            pose[:3, 3] = np.array([ROD.radius, 0, 0.2]) - rotate(pose, surface[middle])
            at = apply(pose, surface)
            pose[:3, 3] -= [ROD.signed_distance(at).min(), 0, 0]
            poses[frame, index] = pose
            facing = rotate(pose, normal) @ inward > 0.8
            depth = np.where(facing, 0.0015 - ROD.signed_distance(apply(pose, surface)), 0.0)
            vectors = -np.maximum(depth, 0.0)[:, None] * normal * K
            wrench[frame, index] = [*vectors.sum(axis=0), *np.cross(surface, vectors).sum(axis=0)]
    return poses, np.tile(np.eye(4), (frames, 1, 1)), wrench


@pytest.mark.parametrize("seed", [1, 2])
def test_net_force_and_moments_are_those_given_where_they_can_be(seed):
    hand = load_hand("allegro")
    poses, objects, wrench = press_of_every_board(hand, seed)
    result = press_layer(hand, ROD, poses, objects, wrench)
    magnitude = np.linalg.norm(wrench[..., :3], axis=-1)
    assert (magnitude > 0.1).all()
    assert np.abs(result.force_residual_n / magnitude).max() < 1e-9, f"seed {seed}"
    reached = np.abs(result.tilt_rad).max(axis=-1) < 0.999 * MAX_TILT_RAD
    assert reached.mean() > 0.5, f"seed {seed}"
    assert (result.moment_residual_nm / magnitude)[reached].max() < 1e-9 * 0.01, f"seed {seed}"


@pytest.mark.parametrize("seed", [3, 4])
def test_separations_are_exact_where_the_boards_rest(seed):
    hand = load_hand("allegro")
    poses, objects, wrench = press_of_every_board(hand, seed)
    rough = press_layer(hand, ROD, poses, objects, wrench, max_tilt_rad=0.0)
    moved = poses.copy()
    magnitude = np.linalg.norm(wrench[..., :3], axis=-1)
    approach = -wrench[..., :3] / magnitude[..., None]
    moved[..., :3, 3] += np.einsum("tsij,tsj->tsi", poses[..., :3, :3], approach) * rough.approach_m[..., None]
    # Without tilts the place of rest is known to the caller: the poses, moved along the approach.
    exact = separations(hand, ROD, moved, objects)
    on = rough.contact_force > 0
    np.testing.assert_allclose(rough.separation[on], exact[on], atol=1e-8, err_msg=f"seed {seed}")


def test_no_wrench_no_force_and_nothing_pressed_in():
    for poses in (above_top(-0.0005), above_top(0.002)):
        result = pressed(flat_hand(), PLANE, poses, np.zeros((1, 1, 6)))
        assert not result.contact_force.any()
        assert (result.separation >= 0).all()
        for left in (result.force_residual_n, result.moment_residual_nm, result.approach_m, result.tilt_rad):
            assert not left.any()


def test_a_symmetric_press_is_symmetric():
    result = pressed(curved_hand(), PLANE, above_top(0.0), push(6.0))
    force = result.contact_force[0].reshape(5, 5)
    np.testing.assert_allclose(force, force[::-1], atol=1e-9)
    np.testing.assert_allclose(force, force[:, ::-1], atol=1e-9)


def test_more_force_presses_no_taxel_less():
    forces = np.array([0.1, 0.5, 1.0, 3.0, 10.0])
    poses, wrench = np.tile(beside_rod(), (5, 1, 1, 1)), np.concatenate([push(force) for force in forces])
    result = press_layer(flat_hand(), ROD, poses, np.tile(np.eye(4), (5, 1, 1)), wrench)
    assert (np.diff(result.contact_force, axis=0) >= -1e-12).all()
    np.testing.assert_allclose(result.contact_force.sum(axis=1), forces, rtol=1e-12)


def test_a_force_beyond_the_taxels_rests_at_the_bound_and_says_what_is_missing():
    result = pressed(flat_hand(), PLANE, above_top(0.0), push(2.0, (0.03, 0.0)))
    assert result.contact_force.sum() == pytest.approx(2.0, rel=3 * MAX_TILT_RAD**2)
    assert abs(result.force_residual_n[0, 0]) < 1e-12
    assert np.abs(result.tilt_rad).max() == pytest.approx(MAX_TILT_RAD)
    assert result.moment_residual_nm[0, 0] > 2.0 * 0.015
    heavy = result.contact_force[0].reshape(5, 5).sum(axis=1)
    assert (np.diff(heavy) >= 0).all()


def test_a_force_between_two_taxels_of_a_bent_board_tilts_it_until_both_bear():
    hand = curved_hand(radius=0.05)
    result = pressed(hand, PLANE, above_top(0.0), push(0.05, (0.002, 0.0)))
    heavy = result.contact_force[0].reshape(5, 5).sum(axis=1)
    assert (heavy > 0).tolist() == [False, False, True, True, False]
    assert result.moment_residual_nm[0, 0] < 1e-12


def test_a_load_that_no_taxel_faces_is_reported_missing():
    result = pressed(flat_hand(), PLANE, above_top(0.0), push(3.0, axis=(0.0, 0.0, 1.0)))
    assert not result.contact_force.any()
    assert result.force_residual_n[0, 0] == pytest.approx(-3.0)


def test_a_frame_does_not_depend_on_the_others():
    hand = load_hand("allegro")
    poses, objects, wrench = press_of_every_board(hand, 6)
    wrench[2, 5] = wrench[4] = 0.0
    whole = press_layer(hand, ROD, poses, objects, wrench)
    for frame in (0, 2, 4):
        one = slice(frame, frame + 1)
        alone = press_layer(hand, ROD, poses[one], objects[one], wrench[one])
        np.testing.assert_allclose(alone.contact_force[0], whole.contact_force[frame], atol=1e-9)
        np.testing.assert_allclose(alone.separation[0], whole.separation[frame], atol=1e-9)
    assert not whole.contact_force[4].any()


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="wrench"):
        pressed(flat_hand(), PLANE, above_top(0.0), np.zeros((1, 2, 6)))
    with pytest.raises(ValueError, match="NaN"):
        pressed(flat_hand(), PLANE, above_top(0.0), np.full((1, 1, 6), np.nan))


def test_separation_is_from_the_surface_and_0_05_where_the_normal_misses():
    hand, one = flat_hand(), np.eye(4)[None]
    for gap in (0.003, 0.0, -0.0004, -0.0025):  # the last: the electrode itself is inside
        np.testing.assert_allclose(separations(hand, PLANE, above_top(gap), one), gap, atol=1e-12)
        np.testing.assert_allclose(distances(hand, PLANE, above_top(gap), one), gap, atol=1e-12)
    for gap in (0.06, -0.0035, -0.2):  # too far; too deep to be a press; in the middle of the object
        np.testing.assert_array_equal(separations(hand, PLANE, above_top(gap), one), MISS_M)
    away = above_top(0.0) @ from_rotation_vector(np.array([np.pi, 0, 0]))
    np.testing.assert_array_equal(separations(hand, PLANE, away, one), MISS_M)


def test_frames_in_which_nothing_moves_have_the_separation_of_the_one_before():
    gaps = [0.004, 0.004, 0.001, 0.001, 0.004, 0.002]
    poses, objects = np.concatenate([above_top(gap) for gap in gaps]), np.repeat(np.eye(4)[None], len(gaps), axis=0)
    objects[5:, 0, 3] = 0.001
    found = separations(flat_hand(), PLANE, poses, objects)
    each = [separations(flat_hand(), PLANE, poses[i : i + 1], objects[i : i + 1])[0] for i in range(len(gaps))]
    np.testing.assert_array_equal(found, each)
    np.testing.assert_allclose(found[:, 0], gaps, atol=1e-12)


def test_a_hand_without_a_layer_is_refused():
    with pytest.raises(LayerThicknessError, match="layer_m"):
        separations(replace(flat_hand(), layer_m=None), PLANE, above_top(0.0), np.eye(4)[None])


def test_an_object_pose_moves_the_object():
    moved = from_rotation_vector(np.array([0.3, -0.2, 0.9]))
    moved[:3, 3] = [0.4, -0.1, 0.2]
    found = separations(flat_hand(), PLANE, moved @ above_top(0.002), moved[None])
    np.testing.assert_allclose(found, 0.002, atol=1e-12)


def coupled(hand, shape, poses, wrench, **options):
    return press_coupled_layer(hand, shape, poses, np.eye(4)[None], wrench, **options)


def test_cells_that_are_not_coupled_are_uncoupled():
    for hand, shape, poses in ((flat_hand(), ROD, beside_rod()), (curved_hand(), PLANE, above_top(0.0))):
        wrench = push(4.0, (0.001, 0.0005))
        alone, none = pressed(hand, shape, poses, wrench), coupled(hand, shape, poses, wrench, decay_m=0.0)
        np.testing.assert_allclose(none.contact_force, alone.contact_force, atol=1e-5)
        np.testing.assert_allclose(none.separation, alone.separation, atol=1e-8)


def test_coupled_cells_feel_a_press_beside_the_contact():
    hand, wrench = flat_hand(), push(1.0, (0.0005, 0.0))
    alone, joined = pressed(hand, ROD, beside_rod(), wrench), coupled(hand, ROD, beside_rod(), wrench)
    assert (joined.contact_force > 0.001).sum() > (alone.contact_force > 0.001).sum()
    beside = (joined.separation >= 0) & (joined.contact_force > 0.001)
    assert beside.any()
    assert joined.contact_force.min() >= 0
    assert joined.contact_force.sum() == pytest.approx(1.0, rel=1e-9)
    assert joined.moment_residual_nm[0, 0] < 1e-12
    # Even pressure is not spread any further: it is even already.
    even = coupled(hand, PLANE, above_top(0.0), push(5.0))
    np.testing.assert_allclose(even.contact_force, 0.2, rtol=1e-9)


def test_coupled_boards_keep_the_net_force_everywhere():
    hand = load_hand("allegro")
    poses, objects, wrench = press_of_every_board(hand, 7, frames=2)
    result = press_coupled_layer(hand, ROD, poses, objects, wrench)
    magnitude = np.linalg.norm(wrench[..., :3], axis=-1)
    assert np.abs(result.force_residual_n / magnitude).max() < 1e-6
    assert result.contact_force.min() >= 0
    assert not press_coupled_layer(hand, ROD, poses, objects, 0 * wrench).contact_force.any()
