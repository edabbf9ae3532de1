"""Import of the contact files of the original simulator."""

import csv

import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.hand import load_hand
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import load_robot
from taxel.hand.transforms import apply
from taxel.recording.grasp_dataset import GraspDataset
from taxel.sim.cone_sensing import NOMINAL_FORCE_N
from taxel.sim.importers.errors import ImportDataError
from taxel.sim.importers.original_contacts import read_original_contacts
from taxel.sim.original_sensing import THRESHOLD_M, OriginalRules, get_centres

HAND = load_hand("original")
PALM = HAND.get_slice(0x15)
ROBOT = load_robot("ur5e_original")
OPTIONS = ("--object", "cylinder", "--approach", "side_1", "--baseline-frames", "100")
CALIBRATION = """format = "taxel-calibration"
version = 1
[[objects]]
name = "cylinder"
pose = { position_m = [0.5, 0.0, 0.1], quaternion_wxyz = [1.0, 0.0, 0.0, 0.0] }
"""


@pytest.fixture
def folder(tmp_path):
    """Create a folder with files of the joint angles (0, arm included) of three grasps and of the object's pose."""
    with (tmp_path / "joints.csv").open("w", newline="") as file:
        rows = [[name, *[0] * len(ROBOT.joint_names)] for name in ("raw_0", "raw_1", "active_0")]
        csv.writer(file).writerows([["grasp", *ROBOT.joint_names], *rows])
    (tmp_path / "objects.toml").write_text(CALIBRATION)
    return tmp_path


def place_centres():
    """Compute the plug-in's taxel centres in the world at joint angles 0, f64[n, 3], metres."""
    poses = Kinematics(ROBOT, HAND).compute_sensor_poses(np.zeros(len(ROBOT.joint_names)))
    centres = get_centres(HAND, OriginalRules())
    return np.concatenate(
        [apply(poses[i], centres[HAND.get_slice(board.address)]) for i, board in enumerate(HAND.boards)]
    )


def write(path, rows):
    """Write numbers as the original does: six decimals and a space at the end of a line."""
    path.write_text("".join(",".join(f"{value:.6f}" for value in row) + " \n" for row in rows))
    return path


def run_import(folder, *files, extra=()):
    """Import files of the folder with the hand and object of the fixture."""
    options = ("--joint-file", folder / "joints.csv", "--calibration", folder / "objects.toml", *OPTIONS, *extra)
    return run_taxel("import", "original-contacts", *files, *options, "--out", folder / "sim.h5", "--noise-counts", "0")


def test_raw_contacts_activate_the_taxels_within_the_threshold(folder):
    centres, offset = place_centres(), np.array([0.0, 0.0, 0.0005])
    touched_taxels = PALM.start + 40, HAND.get_slice(0x08).start + 5
    files = [write(folder / f"raw_{k}.csv", [centres[taxel] + offset]) for k, taxel in enumerate(touched_taxels)]
    assert run_import(folder, *files) == 0
    with GraspDataset(folder / "sim.h5") as data:
        data.check()
        for name, taxel in zip(data.ids, touched_taxels, strict=True):
            force = data[name].contact_force[-1]
            distance = np.linalg.norm(centres - centres[taxel] - offset, axis=1)
            expected = np.flatnonzero(np.nan_to_num(distance, nan=1.0) < THRESHOLD_M)
            assert taxel in expected
            assert np.flatnonzero(force).tolist() == expected.tolist()
            assert (force[expected] == NOMINAL_FORCE_N).all()
        assert [data[name].iteration for name in data.ids] == [0, 1]


def test_a_larger_distance_threshold_activates_more_taxels(folder):
    centre = place_centres()[PALM.start + 40]
    file = write(folder / "raw_0.csv", [centre])
    numbers = []
    for distance in ("2.34", "8"):
        assert run_import(folder, file, extra=("--distance-mm", distance, "--overwrite")) == 0
        with GraspDataset(folder / "sim.h5") as data:
            numbers.append(int((data[data.ids[0]].contact_force[-1] > 0).sum()))
    assert 0 < numbers[0] < numbers[1]


def test_active_points_keep_their_forces(folder):
    centres = place_centres()
    taxels = [PALM.start + 3, HAND.get_slice(0x1C).start + 40]
    file = write(folder / "active_0.csv", [[*centres[t], force] for t, force in zip(taxels, (0.25, 1.5), strict=True)])
    assert run_import(folder, file) == 0
    with GraspDataset(folder / "sim.h5") as data:
        force = data[data.ids[0]].contact_force[-1]
        assert np.flatnonzero(force).tolist() == sorted(taxels)
        np.testing.assert_allclose(force[taxels], [0.25, 1.5], atol=1e-6)


def test_an_active_point_far_from_every_taxel_is_refused(folder, capsys):
    file = write(folder / "active_0.csv", [[0.0, 0.0, 5.0, 1.0]])
    arguments = ("--joint-file", folder / "joints.csv", "--calibration", folder / "objects.toml", *OPTIONS)
    line = run_refused_command(capsys, "import", "original-contacts", file, *arguments, "--out", folder / "sim.h5")
    assert "expected a point within 1 mm of a taxel" in line
    assert not (folder / "sim.h5").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected lines with coordinates"),
        ("1,2\n", "line 1: expected x, y, z or x, y, z, force, found 1,2"),
        ("1,2,3\n1,nan,3\n", "line 2: expected x, y, z or"),
        ("1,2,3\n1,2,3,4\n", "line 2: expected 3 values"),
        ("1,2,3,-4\n", "line 1: expected a force of 0 or more"),
        ("1,2,three\n", "line 1: expected x, y, z or"),
        ("x,2,3\n1,2,3\n", "line 1: expected x, y, z or x, y, z, force, found x,2,3"),
    ],
)
def test_a_damaged_file_gives_one_line_with_the_place(text, message, tmp_path):
    path = tmp_path / "raw.csv"
    path.write_text(text)
    with pytest.raises(ImportDataError) as caught:
        read_original_contacts(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_contact_file_is_refused(tmp_path):
    with pytest.raises(ImportDataError, match="no such file"):
        read_original_contacts(tmp_path / "none.csv")


def test_a_header_line_and_empty_lines_of_a_contact_file_are_skipped(tmp_path):
    (tmp_path / "raw.csv").write_text("x_m,y_m,z_m\n1,2,3 \n\n4,5,6\n")
    lines, points = read_original_contacts(tmp_path / "raw.csv")
    assert lines.tolist() == [2, 4]
    assert points.tolist() == [[1, 2, 3], [4, 5, 6]]
