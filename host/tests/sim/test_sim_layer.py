"""The layer model distributes the wrench of a board over its taxels, and keeps net force and moments."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.hand import load_hand
from taxel.hand.boards import Board, BoardKind
from taxel.hand.description import Hand
from taxel.hand.geometry import Surface
from taxel.hand.transforms import apply, from_rotation_vector, rotate
from taxel.sim.coupled_layer import press_coupled_layer
from taxel.sim.layer import MAX_TILT_RAD, STIFFNESS_N_PER_M, press_layer
from taxel.sim.separation import MISS_M, LayerThicknessError, compute_separations

PITCH_M, LAYER_M, K_N_PER_M = 0.005, 0.001, STIFFNESS_N_PER_M
PLANE = ConvexPolytope.box(0.4, 0.4, 0.4)
ROD = Cylinder(0.03, 0.4)


def make_one_board_hand(position, normal, tx=5, rx=5):
    """Make a hand of one board, whose taxels have the given positions and normals, f64[tx * rx, 3] each."""
    distal = np.tile([1.0, 0.0, 0.0], (len(position), 1))
    kind = BoardKind("test", 1, np.ones((tx, rx), dtype=bool), Surface(position, normal, distal))
    board = Board("test", kind, 0x20, "link", np.eye(4))
    return Hand("test", "one board", PITCH_M, 0.003, (board,), layer_m=LAYER_M)


def make_flat_grid():
    """Return the positions of 5 x 5 taxels in the plane z = 0, f64[25, 3], metres."""
    steps = (np.arange(5) - 2) * PITCH_M
    return np.stack([*np.meshgrid(steps, steps, indexing="ij"), np.zeros((5, 5))], axis=-1).reshape(-1, 3)


def make_flat_hand():
    return make_one_board_hand(make_flat_grid(), np.tile([0.0, 0.0, 1.0], (25, 1)))


def make_curved_hand(radius=0.02):
    """Make a hand of one board of 5 x 5 taxels, bent about the y axis like a fingertip."""
    grid = make_flat_grid()
    angle = grid[:, 0] / radius
    normal = np.stack([np.sin(angle), np.zeros(25), np.cos(angle)], axis=1)
    return make_one_board_hand(np.array([0, 1, 0]) * grid + radius * (normal - [0, 0, 1]), normal)


def place_above_box(gap, rotation=(0.0, 0.0, 0.0)):
    """Return poses f64[1, 1, 4, 4] of a board that faces down, `gap` metres above the top of the box PLANE."""
    pose = from_rotation_vector(np.array(rotation)) @ from_rotation_vector(np.array([np.pi, 0, 0]))
    pose[:3, 3] = [0, 0, PLANE.height + LAYER_M + gap]
    return pose[None, None]


def place_beside_rod(gap=0.0):
    """Return poses f64[1, 1, 4, 4] of a flat board beside ROD: its x axis across the rod axis, its y axis along it."""
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    pose[:3, 3] = [ROD.radius + LAYER_M + gap, 0, 0.2]
    return pose[None, None]


def make_wrench(force, at=(0.0, 0.0), axis=(0.0, 0.0, -1.0)):
    """Return the wrench f64[1, 1, 6] of a force (N) along `axis` through the point `at` (x, y; metres) of the board."""
    vector = force * np.array(axis)
    return np.concatenate([vector, np.cross([*at, 0.0], vector)])[None, None]


def press_on(hand, shape, poses, wrench, **options):
    """Compute the result of the uncoupled layer for an object at the origin."""
    return press_layer(hand, shape, poses, np.eye(4)[None], wrench, **options)


def compute_net_wrench(hand, force):
    """Compute net force and moment of the taxel forces on the board, f64[6], in the frame of the board."""
    vectors = -force[:, None] * hand.normal
    at = hand.position + LAYER_M * hand.normal
    return np.concatenate([vectors.sum(axis=0), np.cross(at, vectors).sum(axis=0)])


def test_a_centred_force_on_a_plane_is_shared_equally():
    gap_m, taxel_force_n = 0.0003, 5.0 / 25  # a force of 5 N on 25 taxels
    result = press_on(make_flat_hand(), PLANE, place_above_box(gap_m), make_wrench(5.0))
    np.testing.assert_allclose(result.contact_force, taxel_force_n, rtol=1e-12)
    np.testing.assert_allclose(result.separation, -taxel_force_n / K_N_PER_M, rtol=1e-12)
    np.testing.assert_allclose(result.approach_m, gap_m + taxel_force_n / K_N_PER_M, rtol=1e-9)
    np.testing.assert_allclose(result.tilt_rad, 0.0, atol=1e-12)


def test_an_off_centre_force_is_spread_linearly():
    hand, at = make_flat_hand(), (0.002, -0.001)
    result = press_on(hand, PLANE, place_above_box(0.0), make_wrench(5.0, at))
    second_moment = np.sum(hand.position[:, 0] ** 2)
    expected = 5.0 * (1 / 25 + (hand.position[:, :2] @ at) / second_moment)
    assert expected.min() > 0
    # Exact except for the cosine of the tilt.
    np.testing.assert_allclose(result.contact_force[0], expected, rtol=1e-3)
    np.testing.assert_allclose(compute_net_wrench(hand, result.contact_force[0]), make_wrench(5.0, at)[0, 0], atol=5e-9)


def test_forces_across_a_rod_follow_its_circular_profile():
    """A force is stiffness times penetration. Beside the middle, the round surface lowers the penetration."""
    hand = make_flat_hand()
    result = press_on(hand, ROD, place_beside_rod(), make_wrench(8.0))
    force = result.contact_force[0].reshape(5, 5)
    np.testing.assert_allclose(force, force[:, :1] * np.ones(5), atol=1e-9)
    np.testing.assert_allclose(force, force[::-1], atol=1e-9)
    x = hand.position.reshape(5, 5, 3)[:, 0, 0]
    depth = force[2, 0] / K_N_PER_M - (ROD.radius - np.sqrt(ROD.radius**2 - x**2))
    np.testing.assert_allclose(force[:, 0], K_N_PER_M * np.maximum(depth, 0), atol=1e-6)
    assert force.sum() == pytest.approx(8.0, rel=1e-12)


@pytest.mark.parametrize("at", [(0.0, 0.0), (0.0015, 0.0), (0.001, -0.0015)])
def test_a_curved_board_on_a_plane_carries_the_load_at_its_point_of_application(at):
    hand = make_curved_hand()
    result = press_on(hand, PLANE, place_above_box(0.0), make_wrench(4.0, at))
    net = compute_net_wrench(hand, result.contact_force[0])
    assert net[2] == pytest.approx(-4.0, rel=1e-12)
    assert result.moment_residual_nm[0, 0] < 4e-9 * 0.005  # 1e-9 of the moment of 4 N at a lever arm of 5 mm
    # The lateral force components of the curved board have almost no lever arm, which the tolerance covers.
    np.testing.assert_allclose([-net[4] / net[2], net[3] / net[2]], at, atol=5e-4)
    assert 0 < (result.contact_force > 0).sum() < 25


def test_force_is_stiffness_times_penetration_for_every_taxel():
    hand = load_hand("allegro")
    poses, objects, wrench = make_rod_loads(hand, 5)
    result = press_layer(hand, ROD, poses, objects, wrench)
    assert (result.contact_force > 0).any(axis=1).all()
    np.testing.assert_allclose(result.contact_force, K_N_PER_M * np.maximum(-result.separation, 0), atol=1e-12)


def make_rod_loads(hand, seed, frames=6):
    """Place boards against ROD with a random taxel in front: (board poses, object poses, wrenches).

    The wrench of a board is that of its layer at these poses, with the taxels that face the rod compressed.
    """
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (frames, len(hand.boards), 1, 1))
    wrench = np.zeros((frames, len(hand.boards), 6))
    for frame in range(frames):
        for index, board in enumerate(hand.boards):
            taxels = hand.get_slice(board.address)
            normal = hand.normal[taxels]
            surface = hand.position[taxels] + hand.layer_m * normal
            middle = rng.integers(len(surface))
            inward = np.array([-1.0, 0.0, 0.0])
            half = normal[middle] + inward
            axis = half / np.linalg.norm(half) if np.linalg.norm(half) > 1e-6 else np.array([0.0, 1.0, 0.0])
            # A rotation by pi about the bisector exchanges two directions.
            pose = from_rotation_vector(rng.uniform(-0.03, 0.03, 3)) @ from_rotation_vector(np.pi * axis)
            pose[:3, 3] = np.array([ROD.radius, 0, 0.2]) - rotate(pose, surface[middle])
            at = apply(pose, surface)
            pose[:3, 3] -= [ROD.signed_distance(at).min(), 0, 0]
            poses[frame, index] = pose
            facing = rotate(pose, normal) @ inward > 0.8
            depth = np.where(facing, 0.0015 - ROD.signed_distance(apply(pose, surface)), 0.0)
            vectors = -np.maximum(depth, 0.0)[:, None] * normal * K_N_PER_M
            wrench[frame, index] = [*vectors.sum(axis=0), *np.cross(surface, vectors).sum(axis=0)]
    return poses, np.tile(np.eye(4), (frames, 1, 1)), wrench


@pytest.mark.parametrize("seed", [1, 2])
def test_net_force_equals_the_given_force_and_moments_too_within_the_tilt_bound(seed):
    hand = load_hand("allegro")
    poses, objects, wrench = make_rod_loads(hand, seed)
    result = press_layer(hand, ROD, poses, objects, wrench)
    magnitude = np.linalg.norm(wrench[..., :3], axis=-1)
    assert (magnitude > 0.1).all()
    assert np.abs(result.force_residual_n / magnitude).max() < 1e-9, f"seed {seed}"
    is_within_tilt_bound = np.abs(result.tilt_rad).max(axis=-1) < 0.999 * MAX_TILT_RAD
    assert is_within_tilt_bound.mean() > 0.5, f"seed {seed}"
    # Relative to the moment that the force has at a lever arm of 10 mm.
    assert (result.moment_residual_nm / magnitude)[is_within_tilt_bound].max() < 1e-9 * 0.01, f"seed {seed}"


@pytest.mark.parametrize("seed", [3, 4])
def test_separations_agree_with_the_displaced_poses(seed):
    hand = load_hand("allegro")
    poses, objects, wrench = make_rod_loads(hand, seed)
    without_tilt = press_layer(hand, ROD, poses, objects, wrench, max_tilt_rad=0.0)
    displaced_poses = poses.copy()
    magnitude = np.linalg.norm(wrench[..., :3], axis=-1)
    approach = -wrench[..., :3] / magnitude[..., None]
    displaced_poses[..., :3, 3] += (
        np.einsum("tsij,tsj->tsi", poses[..., :3, :3], approach) * without_tilt.approach_m[..., None]
    )
    # Without tilt, each board rests at its pose displaced by `approach_m` along the force.
    expected = compute_separations(hand, ROD, displaced_poses, objects)
    is_loaded = without_tilt.contact_force > 0
    np.testing.assert_allclose(
        without_tilt.separation[is_loaded], expected[is_loaded], atol=1e-8, err_msg=f"seed {seed}"
    )


def test_without_a_wrench_there_is_no_force_and_no_penetration():
    for poses in (place_above_box(-0.0005), place_above_box(0.002)):
        result = press_on(make_flat_hand(), PLANE, poses, np.zeros((1, 1, 6)))
        assert not result.contact_force.any()
        assert (result.separation >= 0).all()
        for residual in (result.force_residual_n, result.moment_residual_nm, result.approach_m, result.tilt_rad):
            assert not residual.any()


def test_a_symmetric_load_gives_symmetric_forces():
    result = press_on(make_curved_hand(), PLANE, place_above_box(0.0), make_wrench(6.0))
    force = result.contact_force[0].reshape(5, 5)
    np.testing.assert_allclose(force, force[::-1], atol=1e-9)
    np.testing.assert_allclose(force, force[:, ::-1], atol=1e-9)


def test_no_taxel_force_decreases_with_the_net_force():
    forces = np.array([0.1, 0.5, 1.0, 3.0, 10.0])
    poses, wrench = np.tile(place_beside_rod(), (5, 1, 1, 1)), np.concatenate([make_wrench(force) for force in forces])
    result = press_layer(make_flat_hand(), ROD, poses, np.tile(np.eye(4), (5, 1, 1)), wrench)
    assert (np.diff(result.contact_force, axis=0) >= -1e-12).all()
    np.testing.assert_allclose(result.contact_force.sum(axis=1), forces, rtol=1e-12)


def test_a_force_beside_the_board_tilts_to_the_bound_and_leaves_a_moment_residual():
    """The force acts 30 mm from the centre, the outermost taxels 10 mm: they cannot balance its moment."""
    result = press_on(make_flat_hand(), PLANE, place_above_box(0.0), make_wrench(2.0, (0.03, 0.0)))
    # Exact except for the cosine of the tilt, which differs from 1 by about the square of the tilt.
    assert result.contact_force.sum() == pytest.approx(2.0, rel=3 * MAX_TILT_RAD**2)
    assert abs(result.force_residual_n[0, 0]) < 1e-12
    assert np.abs(result.tilt_rad).max() == pytest.approx(MAX_TILT_RAD)
    # The taxels balance at most 10 mm of the lever arm of 30 mm; the bound of 15 mm is below the remaining 20 mm.
    assert result.moment_residual_nm[0, 0] > 2.0 * 0.015
    row_forces = result.contact_force[0].reshape(5, 5).sum(axis=1)
    assert (np.diff(row_forces) >= 0).all()


def test_a_force_between_two_rows_of_a_bent_board_loads_both_rows():
    """The force acts at x = 2 mm; the rows 2 and 3 are at 0 and 5 mm."""
    hand = make_curved_hand(radius=0.05)
    result = press_on(hand, PLANE, place_above_box(0.0), make_wrench(0.05, (0.002, 0.0)))
    row_forces = result.contact_force[0].reshape(5, 5).sum(axis=1)
    assert (row_forces > 0).tolist() == [False, False, True, True, False]
    assert result.moment_residual_nm[0, 0] < 1e-12


def test_a_pulling_force_is_reported_as_a_force_residual():
    result = press_on(make_flat_hand(), PLANE, place_above_box(0.0), make_wrench(3.0, axis=(0.0, 0.0, 1.0)))
    assert not result.contact_force.any()
    assert result.force_residual_n[0, 0] == pytest.approx(-3.0)


def test_a_frame_does_not_depend_on_other_frames():
    hand = load_hand("allegro")
    poses, objects, wrench = make_rod_loads(hand, 6)
    wrench[2, 5] = wrench[4] = 0.0
    all_frames = press_layer(hand, ROD, poses, objects, wrench)
    for frame in (0, 2, 4):
        single_frame = slice(frame, frame + 1)
        single = press_layer(hand, ROD, poses[single_frame], objects[single_frame], wrench[single_frame])
        np.testing.assert_allclose(single.contact_force[0], all_frames.contact_force[frame], atol=1e-9)
        np.testing.assert_allclose(single.separation[0], all_frames.separation[frame], atol=1e-9)
    assert not all_frames.contact_force[4].any()


def test_a_wrench_of_another_shape_or_nan_is_refused():
    with pytest.raises(ValueError, match="wrench"):
        press_on(make_flat_hand(), PLANE, place_above_box(0.0), np.zeros((1, 2, 6)))
    with pytest.raises(ValueError, match="NaN"):
        press_on(make_flat_hand(), PLANE, place_above_box(0.0), np.full((1, 1, 6), np.nan))


def test_separation_is_measured_from_the_surface_and_is_0_05_without_an_object():
    hand, object_pose = make_flat_hand(), np.eye(4)[None]
    for gap in (0.003, 0.0, -0.0004, -0.0025):  # with the last gap, the electrode is inside the object
        np.testing.assert_allclose(compute_separations(hand, PLANE, place_above_box(gap), object_pose), gap, atol=1e-12)
    for gap in (0.06, -0.0035, -0.2):  # too far, too deep for a contact, at the centre of the object
        np.testing.assert_array_equal(compute_separations(hand, PLANE, place_above_box(gap), object_pose), MISS_M)
    facing_away = place_above_box(0.0) @ from_rotation_vector(np.array([np.pi, 0, 0]))
    np.testing.assert_array_equal(compute_separations(hand, PLANE, facing_away, object_pose), MISS_M)


def test_separations_of_repeated_frames_equal_those_of_single_frames():
    gaps = [0.004, 0.004, 0.001, 0.001, 0.004, 0.002]
    poses, objects = (
        np.concatenate([place_above_box(gap) for gap in gaps]),
        np.repeat(np.eye(4)[None], len(gaps), axis=0),
    )
    objects[5:, 0, 3] = 0.001  # motion of the box along its top face, which keeps the separation
    all_separations = compute_separations(make_flat_hand(), PLANE, poses, objects)
    single_separations = [
        compute_separations(make_flat_hand(), PLANE, poses[i : i + 1], objects[i : i + 1])[0] for i in range(len(gaps))
    ]
    np.testing.assert_array_equal(all_separations, single_separations)
    np.testing.assert_allclose(all_separations[:, 0], gaps, atol=1e-12)


def test_a_hand_without_a_layer_is_refused():
    with pytest.raises(LayerThicknessError, match="layer_m"):
        compute_separations(replace(make_flat_hand(), layer_m=None), PLANE, place_above_box(0.0), np.eye(4)[None])


def test_a_common_motion_of_object_and_board_keeps_the_separation():
    motion = from_rotation_vector(np.array([0.3, -0.2, 0.9]))
    motion[:3, 3] = [0.4, -0.1, 0.2]
    result = compute_separations(make_flat_hand(), PLANE, motion @ place_above_box(0.002), motion[None])
    np.testing.assert_allclose(result, 0.002, atol=1e-12)


def press_coupled_on(hand, shape, poses, wrench, **options):
    """Compute the result of the coupled layer for an object at the origin."""
    return press_coupled_layer(hand, shape, poses, np.eye(4)[None], wrench, **options)


def test_with_a_coupling_length_of_zero_the_coupled_layer_equals_the_uncoupled_layer():
    for hand, shape, poses in (
        (make_flat_hand(), ROD, place_beside_rod()),
        (make_curved_hand(), PLANE, place_above_box(0.0)),
    ):
        wrench = make_wrench(4.0, (0.001, 0.0005))
        uncoupled, coupled_result = (
            press_on(hand, shape, poses, wrench),
            press_coupled_on(hand, shape, poses, wrench, decay_m=0.0),
        )
        np.testing.assert_allclose(coupled_result.contact_force, uncoupled.contact_force, atol=1e-5)
        np.testing.assert_allclose(coupled_result.separation, uncoupled.separation, atol=1e-8)


def test_a_coupled_layer_loads_taxels_beside_the_contact_and_keeps_the_net_force():
    hand, wrench = make_flat_hand(), make_wrench(1.0, (0.0005, 0.0))
    uncoupled, coupled_result = (
        press_on(hand, ROD, place_beside_rod(), wrench),
        press_coupled_on(hand, ROD, place_beside_rod(), wrench),
    )
    assert (coupled_result.contact_force > 0.001).sum() > (uncoupled.contact_force > 0.001).sum()
    is_loaded_without_contact = (coupled_result.separation >= 0) & (coupled_result.contact_force > 0.001)
    assert is_loaded_without_contact.any()
    assert coupled_result.contact_force.min() >= 0
    assert coupled_result.contact_force.sum() == pytest.approx(1.0, rel=1e-9)
    assert coupled_result.moment_residual_nm[0, 0] < 1e-12


def test_coupling_does_not_change_a_uniform_pressure():
    uniform_load = press_coupled_on(make_flat_hand(), PLANE, place_above_box(0.0), make_wrench(5.0))
    np.testing.assert_allclose(uniform_load.contact_force, 5.0 / 25, rtol=1e-9)


def test_coupled_boards_keep_the_net_force_on_every_board():
    hand = load_hand("allegro")
    poses, objects, wrench = make_rod_loads(hand, 7, frames=2)
    result = press_coupled_layer(hand, ROD, poses, objects, wrench)
    magnitude = np.linalg.norm(wrench[..., :3], axis=-1)
    assert np.abs(result.force_residual_n / magnitude).max() < 1e-6
    assert result.contact_force.min() >= 0


def test_coupled_boards_without_a_wrench_have_no_taxel_forces():
    hand = load_hand("allegro")
    poses, objects, wrench = make_rod_loads(hand, 7, frames=2)
    assert not press_coupled_layer(hand, ROD, poses, objects, 0 * wrench).contact_force.any()
