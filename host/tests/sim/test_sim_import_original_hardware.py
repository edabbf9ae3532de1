"""`taxel import original-hardware` and `original-bag`: files of the original ROS stack, and damaged files."""

import json
import random

import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from host.tests.ros.test_original_topics import make_messages, write_bag
from taxel.hand import load_hand
from taxel.hand.kinematics import build_kinematics
from taxel.recording.grasp_dataset import GraspDataset
from taxel.sim.importers.original_hardware import BASE_IN_WORLD, ORIGINAL_OBJECT_POSE
from taxel.sim.sensor_model import SimSensor
from taxel.skin import open_skin

ACTIVE = "grasp_0_active_points_coordinates_{}.csv"
INACTIVE = "grasp_0_inactive_points_coordinates_{}.csv"
JOINTS = "grasp_0_joints_pos_{}.csv"
NAMES = (
    "elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint",
    *(f"joint_{index}_0" for index in range(16)),
)  # fmt: skip
ORDER = (2, 1, 0, *range(3, 22))  # of the robot's joints; the original files begin with the elbow


def write_grasp(folder, seed, iteration=1, hand_name="original"):
    """Write the three files of a grasp as the original stack does; return (signal f64[1324], angles f64[22]).

    The positions are those of the hand at the joint angles, in the frame `world` of the original stack, in single
    precision. Boards that the hand does not have are rows of zeros. A taxel is active from 150 counts on.
    """
    rng = np.random.default_rng(seed)
    complete, hand = load_hand("original_complete"), load_hand(hand_name)
    angles = rng.uniform(-0.3, 0.3, 22)
    centres = build_kinematics(complete).compute_taxel_positions(angles)
    positions = (centres @ BASE_IN_WORLD[:3, :3].T + BASE_IN_WORLD[:3, 3]).astype(np.float32)
    signal = rng.integers(0, 400, complete.n_taxels).astype(float)
    is_fitted = np.zeros(complete.n_taxels, bool)
    for board in hand.boards:
        is_fitted[complete.get_slice(board.address)] = True
    signal[~is_fitted] = 0
    for name, is_listed in ((ACTIVE, signal >= 150), (INACTIVE, is_fitted & (signal < 150))):
        lines = [
            f"{x:.6g},{y:.6g},{z:.6g},{counts:g}" if listed else "0,0,0,0"
            for (x, y, z), counts, listed in zip(positions, signal, is_listed, strict=True)
        ]
        (folder / name.format(iteration)).write_text("\n".join(lines) + "\n")
    lines = [f"{name},{angle!r}\n" for name, angle in zip(NAMES, angles[list(ORDER)].tolist(), strict=True)]
    (folder / JOINTS.format(iteration)).write_text("".join(lines))
    return signal, angles


def import_arguments(folder, *more):
    """Return the command-line arguments to import iteration 1 of the grasp in a folder; more: further options."""
    files = (folder / ACTIVE.format(1), "--object", "cylinder", "--out", folder / "x.h5")
    return ("import", "original-hardware", *files, *more)


def test_hardware_files_become_a_real_dataset_with_the_recorded_differences(tmp_path, capsys):
    seed = random.randrange(1 << 32)
    print("seed", seed)
    hand, complete = load_hand("original"), load_hand("original_complete")
    signals = [write_grasp(tmp_path, seed + iteration, iteration) for iteration in (1, 2)]
    files = [tmp_path / ACTIVE.format(iteration) for iteration in (1, 2)]
    out = tmp_path / "x.h5"
    assert run_taxel("import", "original-hardware", *files, "--object", "cylinder", "--out", out, "--json") == 0
    report = json.loads(capsys.readouterr().out.splitlines()[-1])
    # Each grasp has one frame in the files, and the import adds 100 frames of the baseline.
    assert (report["grasps"], report["frames"], report["added_frames"]) == (2, 202, 200)
    assert report["position_deviation_m"] < 1e-5
    assert report["active_points"] == sum(int((signal >= 150).sum()) for signal, _ in signals)
    with GraspDataset(out) as data:
        assert data.source == "real"
        for name, iteration, (signal, angles) in zip(data.ids, (1, 2), signals, strict=True):
            grasp = data[name]
            assert (grasp.object, grasp.approach, grasp.iteration) == ("cylinder", "grasp_0", iteration)
            counts = np.asarray(grasp.raw_counts, float)
            for board in hand.boards:
                difference = counts[0, hand.get_slice(board.address)] - counts[-1, hand.get_slice(board.address)]
                assert np.array_equal(difference, signal[complete.get_slice(board.address)])
            assert (counts[:-1] == SimSensor().baseline_counts).all()
            assert grasp.valid.all()
            assert np.allclose(grasp.joint_position[-1], angles)
            assert np.allclose(grasp.object_pose, ORIGINAL_OBJECT_POSE)
            assert np.allclose(grasp.sensor_pose, build_kinematics(hand).compute_sensor_poses(angles))
    assert np.allclose(ORIGINAL_OBJECT_POSE[:3, 3], [-0.0044, 0.5437, 0.0237])  # 0.544 m before the base, 24 mm above


def test_boards_whose_rows_are_all_zero_are_marked_invalid(tmp_path):
    write_grasp(tmp_path, 3)
    assert run_taxel(*import_arguments(tmp_path, "--hand", "original_complete")) == 0
    with GraspDataset(tmp_path / "x.h5") as data:
        (name,) = data.ids
        boards = zip(load_hand(data.hand).boards, data[name].valid[-1], strict=True)
        # The boards of the complete hand that the hand `original`, whose files are imported, does not have.
        assert [board.address for board, valid in boards if not valid] == [16, 17, 18, 19, 20]


def test_files_of_the_complete_hand_are_refused_for_the_hand_original(tmp_path, capsys):
    write_grasp(tmp_path, 4, hand_name="original_complete")
    message = run_refused_command(capsys, *import_arguments(tmp_path))
    assert "because hand original has no board 16" in message
    assert "use --hand original_complete" in message
    assert run_taxel(*import_arguments(tmp_path, "--hand", "original_complete")) == 0


def replace_line(path, number, text):
    """Replace one line of a file; text: None deletes the line."""
    lines = path.read_text().splitlines()
    lines[number - 1 : number] = [] if text is None else [text]
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("name", "line", "text", "message"),
    [
        (ACTIVE, 7, None, "expected 1324 rows, one for each taxel of the boards 8 to 29, found 1323"),
        (ACTIVE, 7, "1,2,3", "line 7: expected 4 values x,y,z,counts, found 3"),
        (INACTIVE, 9, "1,2,nan,3", "line 9: expected a finite number, found"),
        (INACTIVE, 9, "1,2,3,x", "line 9: expected a finite number, found"),
        (ACTIVE, 9, "1,2,3,-4", "line 9: expected counts of 0 or more, found -4"),
        (ACTIVE, 9, "1,2,3,65000", "line 9: expected a difference of at most"),
        (JOINTS, 1, "elbow,0.1", "line 1: expected a joint of arm or hand"),
        (JOINTS, 2, "elbow_joint,0.1", "line 2: expected each joint once"),
        (JOINTS, 22, None, "expected a row of joint joint_15_0, found none"),
        (JOINTS, 3, "wrist_1_joint", "line 3: expected 2 values name,position, found 1"),
    ],
)
def test_damaged_file_gives_one_line(tmp_path, capsys, name, line, text, message):
    write_grasp(tmp_path, 5)
    if name is not JOINTS and line == 9:  # remove the taxel from the other file: it must be in only one of the two
        replace_line(tmp_path / (INACTIVE if name is ACTIVE else ACTIVE).format(1), 9, "0,0,0,0")
    replace_line(tmp_path / name.format(1), line, text)
    assert message in run_refused_command(capsys, *import_arguments(tmp_path))
    assert not (tmp_path / "x.h5").exists()


def test_taxel_in_both_files_is_refused(tmp_path, capsys):
    write_grasp(tmp_path, 6)
    for name in (ACTIVE, INACTIVE):
        replace_line(tmp_path / name.format(1), 11, "0.1,0.2,0.3,150")
    message = run_refused_command(capsys, *import_arguments(tmp_path))
    assert "line 11: expected a taxel in one of the two files" in message


@pytest.mark.parametrize("name", [ACTIVE, INACTIVE, JOINTS])
def test_missing_or_binary_file_gives_one_line(tmp_path, capsys, name):
    write_grasp(tmp_path, 7)
    path = tmp_path / name.format(1)
    path.write_bytes(b"\xff\xfe\x00")
    assert "expected UTF-8 text" in run_refused_command(capsys, *import_arguments(tmp_path))
    path.unlink()
    assert "found no such file" in run_refused_command(capsys, *import_arguments(tmp_path))


def test_other_file_name_object_and_hand_are_refused(tmp_path, capsys):
    write_grasp(tmp_path, 8)
    (tmp_path / "points.csv").write_text("0,0,0,0\n")
    out = ("--out", tmp_path / "x.h5")
    command = ("import", "original-hardware")
    message = run_refused_command(capsys, *command, tmp_path / "points.csv", "--object", "cylinder", *out)
    assert "expected a name GRASP_active_points_coordinates_N.csv" in message
    message = run_refused_command(capsys, *command, tmp_path / ACTIVE.format(1), "--object", "can", *out)
    assert "expected an object whose shape is known" in message
    message = run_refused_command(capsys, *import_arguments(tmp_path, "--hand", "allegro"))
    assert "use --hand original or original_complete" in message


def test_bag_is_imported_as_a_recording(tmp_path, capsys):
    messages = make_messages(load_hand("original"))
    bag, out = write_bag(tmp_path / "skin.bag", messages), tmp_path / "skin.mcap"
    assert run_taxel("import", "original-bag", bag, "--out", out) == 0, capsys.readouterr().err
    assert f"{len(messages)} frames" in capsys.readouterr().out
    with open_skin(f"file:{out}") as skin:
        assert [frame.raw_counts.tolist() for frame in skin] == [counts.tolist() for *_, counts in messages]


def test_file_that_is_no_bag_is_refused_in_one_line(tmp_path, capsys):
    path, out = tmp_path / "x.bag", tmp_path / "x.bin"
    assert "found no such file" in run_refused_command(capsys, "import", "original-bag", path, "--out", out)
    path.write_text("text")
    assert "found another file" in run_refused_command(capsys, "import", "original-bag", path, "--out", out)
    path.write_bytes(b"#ROSBAG V2.0\n")
    assert "is no complete ROS 1 bag" in run_refused_command(capsys, "import", "original-bag", path, "--out", out)
