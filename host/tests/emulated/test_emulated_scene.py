"""World files with taxel poses and objects, read by the emulator."""

from dataclasses import replace

import numpy as np
import pytest

from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.grasp.objects import ASSUMED_SIZES, make_thesis_objects
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand import load_hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.transforms import from_rotation_vector
from taxel.hand.world import WorldSettings
from taxel.link import LinkError, run_emulator, write_scene
from taxel.skin import open_skin
from taxel.stream.start_script import write_start_script

OBJECTS = {name: item.shape for name, item in make_thesis_objects(ASSUMED_SIZES).items()}
SETTINGS = WorldSettings(seed=3, noise_counts=0.0)


@pytest.mark.parametrize("name", ["allegro", "flat8"])
def test_emulator_accepts_a_scene_with_displaced_brackets(name, tmp_path):
    hand = load_hand(name)
    offsets = {board.name: from_rotation_vector([0.0, 0.0, 1e-3]) for board in hand.boards}
    run_emulator(format_scene(hand, EmulatedScene(OBJECTS, offsets), SETTINGS), tmp_path / "skin.capture", 0.1)


def test_block_that_moves_onto_a_plate_lowers_the_counts_below_it(tmp_path):
    hand = load_hand("flat8")
    scene = EmulatedScene({"block": ConvexPolytope.box(0.02, 0.02, 0.05)})
    raised_pose, lowered_pose = np.eye(4), np.eye(4)
    raised_pose[2, 3], lowered_pose[2, 3] = 0.05, hand.layer_m - 4e-4  # 5 cm above; 0.4 mm into the layer
    write_scene(
        tmp_path / "scene",
        hand.n_taxels,
        [0.0, 1.0, 1.0],
        [0, 0, 0],
        [raised_pose, raised_pose, lowered_pose],
        np.eye(4)[None, None].repeat(3, 0),
    )
    write_start_script(tmp_path / "start")
    world = format_scene(hand, scene, SETTINGS)
    run_emulator(world, tmp_path / "skin.capture", 2.0, tmp_path / "start", tmp_path / "scene")
    with open_skin(f"file:{tmp_path / 'skin.capture'}", hand) as skin:
        frames = list(skin)
    counts_before = np.mean([frame.raw_counts for frame in frames if 0.5 < frame.time_s < 0.9], axis=0)
    counts_after = np.mean([frame.raw_counts for frame in frames if frame.time_s > 1.2], axis=0)
    # The block covers |x|, |y| < 10 mm; taxels at its border are not checked.
    is_below_block = np.abs(hand.position[:, :2]).max(axis=1) < 0.0075
    is_outside_block = np.abs(hand.position[:, :2]).max(axis=1) > 0.0125
    assert (counts_before - counts_after)[is_below_block].min() > 150
    assert (counts_before - counts_after)[is_outside_block] == pytest.approx(0.0, abs=1.0)


def test_hand_without_a_layer_thickness_and_unsupported_shape_are_rejected():
    hand = load_hand("flat8")
    with pytest.raises(HandGeometryError):
        format_scene(replace(hand, layer_m=None), EmulatedScene(OBJECTS))
    with pytest.raises(TypeError, match="found Blob"):
        format_scene(hand, EmulatedScene({"blob": type("Blob", (), {"bounds": np.array([[0, 0, 0], [1, 1, 1]])})()}))


def test_object_name_with_a_space_is_rejected_by_the_emulator(tmp_path):
    world = format_scene(load_hand("flat8"), EmulatedScene({"two words": OBJECTS["cylinder"]}))
    with pytest.raises(LinkError, match="object"):
        run_emulator(world, tmp_path / "skin.capture", 0.1)


def test_distal_direction_along_the_normal_is_rejected_by_the_emulator(tmp_path):
    hand = load_hand("flat8")
    margin = f"margin 0x{hand.boards[0].address:02X} 0 0 0 0 0 1 0 0 1"  # position, normal, distal direction
    world = f"{format_scene(hand, EmulatedScene(OBJECTS))}{margin}\n"
    with pytest.raises(LinkError, match="distal direction that is not parallel to the normal"):
        run_emulator(world, tmp_path / "skin.capture", 0.1)
