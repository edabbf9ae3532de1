"""Errors in CSV files: each error is one line that names the file, the line and the column."""

import pickle

import pytest

from taxel.hand import load_hand
from taxel.hand.kinematics import Kinematics, compute_taxel_positions
from taxel.hand.robot import load_robot
from taxel.hand.transforms import make_pose
from taxel.recording.grasp_dataset import GraspDataset
from taxel.sim.importers.active_points import import_active
from taxel.sim.importers.errors import ImportDataError
from taxel.sim.importers.gazebo_csv import import_contacts
from taxel.sim.importers.options import ImportOptions

HAND = load_hand("allegro")
ROBOT = load_robot(HAND.robot).get_subtree("palm")
WRIST = make_pose([0.5, 0.0, 0.3], [1, 0, 0, 0])
CENTRES = compute_taxel_positions(HAND, WRIST @ Kinematics(ROBOT, HAND).compute_sensor_poses([0.0] * 16))
OPTIONS = ImportOptions(
    HAND, object_poses={"cylinder": make_pose([0.535, 0, 0.2], [1, 0, 0, 0])}, wrist_pose=WRIST, baseline_frames=100
)

X, Y, Z = CENTRES[3].tolist()
CONTACT_HEADER = "grasp,object,approach,time,x,y,z"
CONTACT_ROW = f"1,cylinder,top,0.5,{X},{Y},{Z}"
POINT_HEADER, POINT_ROW = "grasp,object,approach,x,y,z,active", f"1,cylinder,top,{X},{Y},{Z},1"
JOINT_HEADER, ANGLE_ROW = f"grasp,{','.join(ROBOT.joint_names)}", f"1{',0' * 16}"


def join_lines(*rows):
    """Return the content of a text file with the given lines."""
    return "\n".join(rows) + "\n"


CONTACTS, JOINTS, POINTS = (
    join_lines(CONTACT_HEADER, CONTACT_ROW),
    join_lines(JOINT_HEADER, ANGLE_ROW),
    join_lines(POINT_HEADER, POINT_ROW),
)


def run_import(tmp_path, convert, data_file, joints=JOINTS, options=OPTIONS, **options_of_import):
    """Write `data_file` to c.csv and `joints` to j.csv, and import both with the function `convert`."""
    for name, content in (("c.csv", data_file), ("j.csv", joints)):
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return convert(
        tmp_path / "c.csv", tmp_path / "sim.h5", joints=tmp_path / "j.csv", options=options, **options_of_import
    )


def read_import_error(tmp_path, *args, **options_of_import):
    """Return the one-line message of an import that fails, without the folder name; arguments as for `run_import`.

    Checks that the import leaves no other file behind, and that the error can be pickled.
    """
    with pytest.raises(ImportDataError) as caught:
        run_import(tmp_path, *args, **options_of_import)
    assert [path.name for path in tmp_path.iterdir() if path.suffix != ".csv"] == []
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value)
    assert "\n" not in str(copy)
    return str(copy).replace(f"{tmp_path}/", "")


@pytest.mark.parametrize(("convert", "data_file"), [(import_contacts, CONTACTS), (import_active, POINTS)])
def test_the_unmodified_files_are_imported_as_a_valid_dataset(tmp_path, convert, data_file):
    run_import(tmp_path, convert, data_file)
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()


INVALID_CONTACTS = {  # case: (file content, expected part of the error)
    "missing column": (CONTACTS.replace(",z", ""), "c.csv: line 1: expected a column z"),
    "misspelt column": (CONTACTS.replace("approach", "aproach"), "line 1: expected known columns, found 'aproach'"),
    "repeated column": (CONTACTS.replace("time,x", "time,px,x"), "'x', a second column x"),
    "semicolons instead of commas": (CONTACTS.replace(",", ";"), "line 1: expected columns separated by commas"),
    "decimal comma": (CONTACTS.replace("0.5,", "0,5,", 1), "line 2: expected 7 values, found 8"),
    "word instead of a number": (
        CONTACTS.replace(",0.5,", ",soon,"),
        "line 2, column time: expected a finite number, found 'soon'",
    ),
    "NaN": (CONTACTS.replace(",0.5,", ",nan,"), "line 2, column time"),
    "enormous number": (
        CONTACTS.replace(",0.5,", ",1e308,"),
        "line 2, column time: expected a number of at most 1e+15, found '1e308'",
    ),
    "header only": (CONTACT_HEADER, "c.csv: file: expected rows"),
    "empty file": ("", "line 1: expected a column grasp"),
    "not UTF-8": (b"grasp\xff\n", "UTF-8"),
    "unclosed quote": (join_lines(CONTACT_HEADER, '"1,cylinder'), "c.csv: line 2: expected comma-separated values"),
    "unknown object": (
        CONTACTS.replace("cylinder", "cylindre"),
        "column object: expected an object whose shape is known",
    ),
    "missing object name": (CONTACTS.replace("cylinder", ""), "line 2, column object: expected a name"),
    "two objects in a grasp": (
        join_lines(CONTACT_HEADER, CONTACT_ROW, CONTACT_ROW.replace("cylinder", "can")),
        "line 3, column object: expected the same object",
    ),
    "incomplete position": (CONTACTS.replace(str(X), ""), "line 2, column x: expected a finite number, found nothing"),
    "negative force": (
        join_lines(f"{CONTACT_HEADER},force", f"{CONTACT_ROW},-1"),
        "line 2, column force: expected newtons of 0 or more",
    ),
    "force vector and magnitude": (
        join_lines(f"{CONTACT_HEADER},force,fx,fy,fz", f"{CONTACT_ROW},1,0,0,1"),
        "expected fx, fy, fz or force, found both",
    ),
    "incomplete force vector": (
        join_lines(f"{CONTACT_HEADER},fx,fy", f"{CONTACT_ROW},1,0"),
        "expected columns fx, fy, fz, found no fz",
    ),
    "missing force": (
        join_lines(f"{CONTACT_HEADER},force", f"{CONTACT_ROW},"),
        "line 2, column force: expected a finite number, found nothing",
    ),
    "normal of length zero": (
        join_lines(f"{CONTACT_HEADER},fx,fy,fz,nx,ny,nz", f"{CONTACT_ROW},1,0,0,0,0,0"),
        "line 2, column nx: expected a direction",
    ),
    "unknown board": (join_lines(f"{CONTACT_HEADER},board", f"{CONTACT_ROW},plam"), "did you mean palm"),
    "unknown phase": (
        join_lines(f"{CONTACT_HEADER},phase", f"{CONTACT_ROW},gripping"),
        "line 2, column phase: expected 0 to 4 or baseline",
    ),
    "two phases at a time": (
        join_lines(f"{CONTACT_HEADER},phase", f"{CONTACT_ROW},1", f"{CONTACT_ROW},2"),
        "column phase: expected one phase at a time",
    ),
    "grasp without joint angles": (CONTACTS.replace("\n1,", "\n7,"), "j.csv: grasp: expected rows of grasp '7'"),
    "iteration not an integer": (
        join_lines(f"{CONTACT_HEADER},iteration", f"{CONTACT_ROW},1.5"),
        "column iteration: expected an integer",
    ),
    "position in millimetres": (
        CONTACTS.replace(f"{X},{Y},{Z}", "513,-23,260"),
        "line 2, column x: expected contacts of a grasp",
    ),
}


@pytest.mark.parametrize("case", INVALID_CONTACTS)
def test_each_error_in_contact_points_gives_its_one_line_message(tmp_path, case):
    text, message = INVALID_CONTACTS[case]
    assert message in read_import_error(tmp_path, import_contacts, text)


INVALID_JOINTS = {  # case: (file content, expected part of the error)
    "unknown joint": (JOINTS.replace("ff_j2", "ff_j9"), "j.csv: line 1: expected known columns, found 'ff_j9'"),
    "missing joint": (join_lines(JOINT_HEADER.replace(",th_j3", ""), ANGLE_ROW[:-2]), "expected a column th_j3"),
    "arm joints and wrist pose": (
        join_lines(f"{JOINT_HEADER},elbow", f"{ANGLE_ROW},0"),
        "expected joints of the arm or a pose of the wrist, found both",
    ),
    "second row without times": (
        join_lines(JOINT_HEADER, ANGLE_ROW, ANGLE_ROW),
        "line 3, column grasp: expected one row for a grasp",
    ),
    "decreasing times": (
        join_lines(f"{JOINT_HEADER},time", f"{ANGLE_ROW},1", f"{ANGLE_ROW},0.5"),
        "line 3, column time: expected increasing times within a grasp",
    ),
    "times of another clock": (
        join_lines(f"{JOINT_HEADER},time", f"{ANGLE_ROW},8", f"{ANGLE_ROW},9"),
        "expected times from 0.5 to 0.5 s for grasp '1', found 8 to 9 s",
    ),
    "times that do not occur in the contacts": (
        join_lines(f"{JOINT_HEADER},time,phase", f"{ANGLE_ROW},0.4,1", f"{ANGLE_ROW},0.6,2"),
        "c.csv: line 2, column time: expected a time of",
    ),
    "incomplete pose": (join_lines(f"{JOINT_HEADER},object_x", f"{ANGLE_ROW},0"), "found no object_y"),
    "quaternion of length zero": (
        join_lines(
            f"{JOINT_HEADER},{','.join(f'object_{p}' for p in ('x', 'y', 'z', 'qw', 'qx', 'qy', 'qz'))}",
            f"{ANGLE_ROW}{',0' * 7}",
        ),
        "line 2, column object_qw: expected a quaternion",
    ),
}


@pytest.mark.parametrize("case", INVALID_JOINTS)
def test_each_error_in_joint_angles_gives_its_one_line_message(tmp_path, case):
    text, message = INVALID_JOINTS[case]
    assert message in read_import_error(tmp_path, import_contacts, CONTACTS, text)


INVALID_POINTS = {  # case: (file content, expected part of the error)
    "point beside the taxels": (
        POINTS.replace(f"{X},", f"{X + 0.0012},"),
        "line 2, column x: expected a point within 1 mm",
    ),
    "repeated taxel": (
        join_lines(POINT_HEADER, POINT_ROW, POINT_ROW),
        "line 3, column x: expected each taxel once, found taxel 3",
    ),
    "neither 0 nor 1": (
        join_lines(POINT_HEADER, POINT_ROW[:-1] + "2"),
        "line 2, column active: expected 0 or 1, found 2",
    ),
}


@pytest.mark.parametrize("case", INVALID_POINTS)
def test_each_error_in_active_taxels_gives_its_one_line_message(tmp_path, case):
    text, message = INVALID_POINTS[case]
    assert message in read_import_error(tmp_path, import_active, text)


def test_points_without_times_are_refused_for_joint_angles_with_times(tmp_path):
    joints = join_lines(f"{JOINT_HEADER},time", f"{ANGLE_ROW},1", f"{ANGLE_ROW},2")
    assert "expected a column time, found none; j.csv has 2 times of grasp '1'" in read_import_error(
        tmp_path, import_active, POINTS, joints
    )


def test_a_dataset_without_baseline_frames_is_refused_with_the_option_to_add_them(tmp_path):
    options = ImportOptions(HAND, object_poses=OPTIONS.object_poses, wrist_pose=WRIST)
    message = read_import_error(tmp_path, import_contacts, CONTACTS, options=options)
    assert (
        "expected 100 frames of phase 0 (baseline) in grasp '0001', found 0; taxels are active relative to a baseline"
        in message
    )
    assert "--baseline-frames 100" in message


def test_an_object_without_a_pose_is_refused(tmp_path):
    options = ImportOptions(HAND, wrist_pose=WRIST, baseline_frames=100)
    message = read_import_error(tmp_path, import_contacts, CONTACTS, options=options)
    assert "expected the pose of 'cylinder'" in message
    assert "calibration" in message


def test_hand_joints_without_arm_joints_and_without_a_wrist_pose_are_refused(tmp_path):
    options = ImportOptions(HAND, object_poses=OPTIONS.object_poses, baseline_frames=100)
    message = read_import_error(tmp_path, import_contacts, CONTACTS, options=options)
    assert "j.csv: line 1: expected 22 joints, or 16 joints and the pose of the wrist, found 16 joints only" in message


def test_each_error_in_poses_gives_its_message(tmp_path):
    (tmp_path / "c.csv").write_text(CONTACTS)
    header = "grasp,link,x,y,z,qw,qx,qy,qz"
    cases = [
        (
            join_lines(header.replace(",link", ""), "1,0,0,0,1,0,0,0"),
            "expected a column link or a column board, found neither",
        ),
        (
            join_lines(header, "1,palm,0,0,0,1,0,0,0"),
            "link: expected a row of th_distal, found none at 0 s of grasp '1'",
        ),
        (join_lines(header, *["1,palm,0,0,0,1,0,0,0"] * 2), "line 3, column link: expected each link once at a time"),
        (join_lines(header.replace(",qz", ""), "1,palm,0,0,0,1,0,0"), "expected a column qz"),
    ]
    for text, message in cases:
        (tmp_path / "p.csv").write_text(text)
        with pytest.raises(ImportDataError) as caught:
            import_contacts(tmp_path / "c.csv", tmp_path / "sim.h5", poses=tmp_path / "p.csv", options=OPTIONS)
        assert message in str(caught.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(ImportDataError, match=r"none\.csv: file: expected a CSV file, found no such file"):
        import_contacts(tmp_path / "none.csv", tmp_path / "sim.h5", joints=tmp_path / "j.csv", options=OPTIONS)
    with pytest.raises(ImportDataError, match="found a folder"):
        import_contacts(tmp_path, tmp_path / "sim.h5", joints=tmp_path / "j.csv", options=OPTIONS)


def test_invalid_arguments_of_the_import_functions_raise_value_errors(tmp_path):
    with pytest.raises(ValueError, match="threshold_m"):
        run_import(tmp_path, import_contacts, CONTACTS, threshold_m=0.0)
    with pytest.raises(ValueError, match="both or neither"):
        import_contacts(tmp_path / "c.csv", tmp_path / "sim.h5", options=OPTIONS)
