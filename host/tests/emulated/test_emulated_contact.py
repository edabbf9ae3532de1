"""Contact of the emulated skin through ctypes: forces, stiffness, offsets and rejected arguments."""

import os
import pickle
import tempfile
from collections.abc import Iterator

import numpy as np
import pytest

from taxel.emulated.contact import ContactLibraryError, SkinContact
from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.hand import load_hand
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import from_rotation_vector
from taxel.hand.world import format_world

FLAT8, ALLEGRO = load_hand("flat8"), load_hand("allegro")
LAYER_M = 0.002
BRACKET_POSES = np.eye(4)[None]
"""Pose of the only bracket of the hand flat8, world."""
SCENE = EmulatedScene({"block": ConvexPolytope.box(0.1, 0.1, 0.05), "rod": Cylinder(0.008, 0.1)})


def make_translation(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    """Make a translation f64[4, 4] by x, y and z metres."""
    result = np.eye(4)
    result[:3, 3] = x, y, z
    return result


def place_block(depth_m: float) -> np.ndarray:
    """Return the pose of the block whose lower face is at this depth below the surface of the unloaded layer."""
    return make_translation(z=LAYER_M - depth_m)


@pytest.fixture(scope="module")
def flat8() -> Iterator[SkinContact]:
    """Yield the contact of the hand flat8 (one flat board) with the objects of the scene."""
    with SkinContact(format_scene(FLAT8, SCENE)) as contact:
        yield contact


def test_contact_has_as_many_boards_and_taxels_as_the_hand():
    with SkinContact(format_scene(ALLEGRO, SCENE)) as contact:
        assert (contact.board_count, contact.taxel_count) == (len(ALLEGRO.boards), ALLEGRO.n_taxels)


def test_large_block_loads_all_taxels_equally_and_also_the_margin_of_the_board(flat8):
    forces = flat8.compute_forces(0, place_block(3e-4), BRACKET_POSES)
    load = flat8.compute_load(0, place_block(3e-4), BRACKET_POSES)
    assert load.touched_board_count == 1
    assert forces.min() > 0
    assert forces == pytest.approx(np.full(64, forces[0]))
    squares = build_sheet(FLAT8).n_taxels  # 64 taxels and 32 squares of the margin, which have no taxel
    assert load.wrench[0] == pytest.approx([0, 0, -forces[0] * squares, 0, 0, 0], abs=1e-9)


def test_force_rises_more_than_linearly_with_depth(flat8):
    forces = np.array(
        [flat8.compute_forces(0, place_block(depth), BRACKET_POSES).sum() for depth in np.linspace(0.0, 6e-4, 13)]
    )
    assert forces[0] == 0
    assert (np.diff(forces) > 0).all()
    assert forces[-1] - forces[-2] > forces[2] - forces[1]


def test_there_is_no_load_without_contact_or_without_object(flat8):
    for index, pose in (
        (0, place_block(-1e-5)),  # 10 um above the skin
        (0, make_translation(z=1.0)),
        (0, make_translation(x=0.2)),  # beside the board
        (-1, place_block(5e-4)),  # -1: no object
    ):
        load = flat8.compute_load(index, pose, BRACKET_POSES)
        assert load.touched_board_count == 0
        assert not load.wrench.any()
        assert not load.stiffness.any()
        assert not flat8.compute_forces(index, pose, BRACKET_POSES).any()


@pytest.mark.parametrize("seed", range(6))
def test_stiffness_is_symmetric_positive_semidefinite_and_the_negative_derivative_of_the_wrench(flat8, seed):
    """The derivative is measured with central differences for small motions along and about each axis of the board.

    Only motions along the normal and about the two axes in the plane of the board are compared with this derivative.
    """
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    tilt = from_rotation_vector([*rng.uniform(-4e-3, 4e-3, 2), rng.uniform(-3.0, 3.0)])
    object_pose = place_block(5e-4) @ tilt
    load, step = flat8.compute_load(0, object_pose, BRACKET_POSES), 1e-7
    measured = np.zeros((6, 6))
    for axis in range(6):
        for sign in (1, -1):
            motion = np.zeros(6)
            motion[axis] = sign * step
            bracket = from_rotation_vector(motion[3:])
            bracket[:3, 3] = motion[:3]
            wrench = flat8.compute_load(0, object_pose, bracket[None]).wrench[0]
            measured[:, axis] -= sign * wrench / (2 * step)
    scale = np.sqrt(np.outer(np.diag(load.stiffness[0]), np.diag(load.stiffness[0])).max())
    assert load.stiffness[0] == pytest.approx(load.stiffness[0].T, abs=1e-9 * scale)
    assert np.linalg.eigvalsh(load.stiffness[0]).min() > -1e-6 * scale
    normal = np.ix_([2, 3, 4], [2, 3, 4])
    assert measured[normal] == pytest.approx(load.stiffness[0][normal], rel=0.03, abs=1e-3)


def test_rod_loads_only_the_strip_of_taxels_below_it(flat8):
    rod_pose = from_rotation_vector([np.pi / 2, 0.0, 0.0])  # rod axis along -y of the board
    rod_pose[:3, 3] = 0.0, 0.05, LAYER_M + 0.008 - 3e-4  # radius 8 mm, indentation 0.3 mm
    forces = flat8.compute_forces(1, rod_pose, BRACKET_POSES)
    is_below_rod = np.abs(FLAT8.position[:, 0]) < 0.004
    assert (forces[is_below_rod] > 0).all()
    assert not forces[~is_below_rod].any()


def test_common_motion_of_board_and_object_does_not_change_the_load(flat8):
    motion = from_rotation_vector([0.4, -0.8, 0.3])
    motion[:3, 3] = 0.5, -0.2, 0.1
    at_rest, moved_load = (
        flat8.compute_load(0, place_block(3e-4), BRACKET_POSES),
        flat8.compute_load(0, motion @ place_block(3e-4), motion[None]),
    )
    assert moved_load.wrench == pytest.approx(at_rest.wrench, rel=1e-6, abs=1e-6)


def test_offsets_of_brackets_and_objects_are_applied_to_nominal_poses():
    bracket_offset, object_offset = from_rotation_vector([0.0, 0.0, 0.2]), make_translation(0.001, 0.0, -1e-4)
    bracket_offset[:3, 3] = 2e-4, -3e-4, 1e-4
    scene = EmulatedScene(SCENE.objects, {"flat8": bracket_offset}, {"rod": object_offset, "block": object_offset})
    with (
        SkinContact(format_scene(FLAT8, SCENE)) as ideal_contact,
        SkinContact(format_scene(FLAT8, scene)) as offset_contact,
    ):
        assert offset_contact.get_bracket_offset(0) == pytest.approx(bracket_offset, abs=1e-9)
        assert ideal_contact.get_bracket_offset(0) == pytest.approx(np.eye(4))
        nominal = offset_contact.compute_load(0, place_block(2e-4), BRACKET_POSES)
        expected = ideal_contact.compute_load(0, place_block(2e-4) @ object_offset, bracket_offset[None])
        assert nominal.wrench == pytest.approx(expected.wrench, rel=1e-6, abs=1e-9)
        # The offset of -0.1 mm along z presses the object deeper into the skin.
        assert nominal.wrench[0, 2] < ideal_contact.compute_load(0, place_block(2e-4), BRACKET_POSES).wrench[0, 2]


@pytest.mark.parametrize(
    ("world", "message"),
    [
        ("taxel-world 1\nnonsense 4\n", r"^world file, line 2: .* \(found 'nonsense 4'\)$"),
        (format_world(FLAT8), "surface"),
        (format_scene(FLAT8, SCENE) + "effect spread film length_m=-1\n", "length_m"),
        (format_scene(FLAT8, SCENE) + "bracket_offset 0x22 0 0 0 0 0 0\n", "0x22"),
    ],
)
def test_invalid_world_is_rejected_with_a_one_line_message_and_nothing_is_printed(world, message, capfd):
    with pytest.raises(ContactLibraryError, match=message) as caught:
        SkinContact(world)
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    assert capfd.readouterr().err == ""


def test_arguments_that_the_library_does_not_check_are_rejected(flat8):
    with pytest.raises(ValueError, match="an object from -1 to 1, found 2"):
        flat8.compute_load(2, place_block(0.0), BRACKET_POSES)
    with pytest.raises(ValueError, match=r"poses of 1 brackets, found \(2, 4, 4\)"):
        flat8.compute_load(0, place_block(0.0), np.stack([np.eye(4)] * 2))
    with pytest.raises(ValueError, match=r"the pose of an object, found \(3,\)"):
        flat8.compute_load(0, np.zeros(3), BRACKET_POSES)
    with pytest.raises(ValueError, match="an index from 0 to 0, found 1"):
        flat8.get_bracket_offset(1)
    with pytest.raises(ValueError, match="an index from 0 to 0, found -1"):
        flat8.get_bracket_offset(-1)


def test_closed_contact_raises_an_error_and_can_be_closed_again():
    contact = SkinContact(format_scene(FLAT8, SCENE))
    contact.close()
    contact.close()
    with pytest.raises(ValueError, match="found a closed one"):
        contact.compute_load(0, place_block(0.0), BRACKET_POSES)


def test_contacts_leave_no_files_and_no_descriptors(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    descriptors = set(os.listdir("/proc/self/fd"))
    for _ in range(5):
        SkinContact(format_scene(FLAT8, SCENE)).close()
        with pytest.raises(ContactLibraryError):
            SkinContact("")
    assert len(set(os.listdir("/proc/self/fd")) - descriptors) == 0
    assert list(tmp_path.iterdir()) == []
