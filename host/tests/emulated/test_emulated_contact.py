"""The emulated skin's contact through ctypes: forces, stiffness, offsets, and what is refused."""

from __future__ import annotations

import os
import pickle
import tempfile
from collections.abc import Iterator

import numpy as np
import pytest

from taxel.emulated.contact import ContactLibraryError, SkinContact
from taxel.emulated.scene import Scene, scene_text
from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.hand import load_hand
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import from_rotation_vector
from taxel.hand.world import format_world

FLAT8, ALLEGRO = load_hand("flat8"), load_hand("allegro")
LAYER_M = 0.002
HERE = np.eye(4)[None]
BLOCK = Scene({"block": ConvexPolytope.box(0.1, 0.1, 0.05), "rod": Cylinder(0.008, 0.1)})


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    result = np.eye(4)
    result[:3, 3] = x, y, z
    return result


def pressed(depth_m: float) -> np.ndarray:
    """The block with its lower face so deep in the layer of a board that looks up."""
    return at(z=LAYER_M - depth_m)


@pytest.fixture(scope="module")
def flat8() -> Iterator[SkinContact]:
    with SkinContact(scene_text(FLAT8, BLOCK)) as contact:
        yield contact


def test_it_has_the_hands_boards_and_taxels():
    with SkinContact(scene_text(ALLEGRO, BLOCK)) as contact:
        assert (contact.boards, contact.taxels) == (len(ALLEGRO.boards), ALLEGRO.n_taxels)


def test_a_block_presses_all_taxels_alike_and_pushes_the_board_and_its_margin_away(flat8):
    forces = flat8.forces(0, pressed(3e-4), HERE)
    load = flat8.load(0, pressed(3e-4), HERE)
    assert load.touched == 1
    assert forces.min() > 0
    assert forces == pytest.approx(np.full(64, forces[0]))
    assert load.wrench[0] == pytest.approx([0, 0, -forces[0] * build_sheet(FLAT8).n_taxels, 0, 0, 0], abs=1e-9)


def test_force_rises_with_depth_ever_more_steeply(flat8):
    forces = np.array([flat8.forces(0, pressed(depth), HERE).sum() for depth in np.linspace(0.0, 6e-4, 13)])
    assert forces[0] == 0
    assert (np.diff(forces) > 0).all()
    assert forces[-1] - forces[-2] > forces[2] - forces[1]


def test_nothing_is_pressed_without_contact_or_object(flat8):
    for index, pose in ((0, pressed(-1e-5)), (0, at(z=1.0)), (0, at(x=0.2)), (-1, pressed(5e-4))):
        load = flat8.load(index, pose, HERE)
        assert load.touched == 0
        assert not load.wrench.any()
        assert not load.stiffness.any()
        assert not flat8.forces(index, pose, HERE).any()


@pytest.mark.parametrize("seed", range(6))
def test_the_stiffness_is_how_the_wrench_falls(flat8, seed):
    """Central differences over a small motion of the board along and about each of its axes."""
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    tilt = from_rotation_vector([*rng.uniform(-4e-3, 4e-3, 2), rng.uniform(-3.0, 3.0)])
    object_pose = pressed(5e-4) @ tilt
    load, step = flat8.load(0, object_pose, HERE), 1e-7
    measured = np.zeros((6, 6))
    for axis in range(6):
        for sign in (1, -1):
            motion = np.zeros(6)
            motion[axis] = sign * step
            bracket = from_rotation_vector(motion[3:])
            bracket[:3, 3] = motion[:3]
            wrench = flat8.load(0, object_pose, bracket[None]).wrench[0]
            measured[:, axis] -= sign * wrench / (2 * step)
    scale = np.sqrt(np.outer(np.diag(load.stiffness[0]), np.diag(load.stiffness[0])).max())
    assert load.stiffness[0] == pytest.approx(load.stiffness[0].T, abs=1e-9 * scale)
    assert np.linalg.eigvalsh(load.stiffness[0]).min() > -1e-6 * scale
    normal = np.ix_([2, 3, 4], [2, 3, 4])
    assert measured[normal] == pytest.approx(load.stiffness[0][normal], rel=0.03, abs=1e-3)


def test_the_rod_presses_a_strip(flat8):
    upright = from_rotation_vector([np.pi / 2, 0.0, 0.0])  # its axis along -y of the board
    upright[:3, 3] = 0.0, 0.05, LAYER_M + 0.008 - 3e-4
    forces = flat8.forces(1, upright, HERE)
    pressed_taxels = np.abs(FLAT8.position[:, 0]) < 0.004
    assert (forces[pressed_taxels] > 0).all()
    assert not forces[~pressed_taxels].any()


def test_motion_of_board_and_object_together_changes_nothing(flat8):
    motion = from_rotation_vector([0.4, -0.8, 0.3])
    motion[:3, 3] = 0.5, -0.2, 0.1
    still, moved = flat8.load(0, pressed(3e-4), HERE), flat8.load(0, motion @ pressed(3e-4), motion[None])
    assert moved.wrench == pytest.approx(still.wrench, rel=1e-6, abs=1e-6)


def test_offsets_of_brackets_and_objects_are_applied():
    shift, lift = from_rotation_vector([0.0, 0.0, 0.2]), at(0.001, 0.0, -1e-4)
    shift[:3, 3] = 2e-4, -3e-4, 1e-4
    scene = Scene(BLOCK.objects, {"flat8": shift}, {"rod": lift, "block": lift})
    with SkinContact(scene_text(FLAT8, BLOCK)) as ideal, SkinContact(scene_text(FLAT8, scene)) as real:
        assert real.bracket_offset(0) == pytest.approx(shift, abs=1e-9)
        assert real.object_offset(0) == pytest.approx(lift, abs=1e-9)
        assert ideal.bracket_offset(0) == pytest.approx(np.eye(4))
        believed = real.load(0, pressed(2e-4), HERE)
        true = ideal.load(0, pressed(2e-4) @ lift, shift[None])
        assert believed.wrench == pytest.approx(true.wrench, rel=1e-6, abs=1e-9)
        assert believed.wrench[0, 2] < ideal.load(0, pressed(2e-4), HERE).wrench[0, 2]


@pytest.mark.parametrize(
    ("world", "complaint"),
    [
        ("taxel-world 1\nnonsense 4\n", r"^world file, line 2: .* \(found 'nonsense 4'\)$"),
        (format_world(FLAT8), "surface"),
        (scene_text(FLAT8, BLOCK) + "effect spread film length_m=-1\n", "length_m"),
        (scene_text(FLAT8, BLOCK) + "bracket_offset 0x22 0 0 0 0 0 0\n", "0x22"),
    ],
)
def test_a_wrong_world_is_refused_in_one_line(world, complaint, capfd):
    with pytest.raises(ContactLibraryError, match=complaint) as caught:
        SkinContact(world)
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    assert capfd.readouterr().err == ""


def test_what_the_library_would_not_notice_is_refused(flat8):
    with pytest.raises(ValueError, match="an object from -1 to 1, found 2"):
        flat8.load(2, pressed(0.0), HERE)
    with pytest.raises(ValueError, match=r"poses of 1 brackets, found \(2, 4, 4\)"):
        flat8.load(0, pressed(0.0), np.stack([np.eye(4)] * 2))
    with pytest.raises(ValueError, match=r"the pose of an object, found \(3,\)"):
        flat8.load(0, np.zeros(3), HERE)
    with pytest.raises(ValueError, match="a number from 0 to 0, found 1"):
        flat8.bracket_offset(1)
    with pytest.raises(ValueError, match="a number from 0 to 1, found -1"):
        flat8.object_offset(-1)


def test_a_closed_contact_says_so_and_closes_again():
    contact = SkinContact(scene_text(FLAT8, BLOCK))
    contact.close()
    contact.close()
    with pytest.raises(ValueError, match="found a closed one"):
        contact.load(0, pressed(0.0), HERE)


def test_many_contacts_leave_no_files_and_no_descriptors(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    descriptors = set(os.listdir("/proc/self/fd"))
    for _ in range(5):
        SkinContact(scene_text(FLAT8, BLOCK)).close()
        with pytest.raises(ContactLibraryError):
            SkinContact("")
    assert len(set(os.listdir("/proc/self/fd")) - descriptors) == 0
    assert list(tmp_path.iterdir()) == []
