"""Mistakes in CSV files: each is one line that names the file, the line and the column."""

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
    object_poses={"cylinder": make_pose([0.535, 0, 0.2], [1, 0, 0, 0])}, wrist_pose=WRIST, baseline_frames=100
)

X, Y, Z = CENTRES[3].tolist()
HEAD = "grasp,object,approach,time,x,y,z"
ROW = f"1,cylinder,top,0.5,{X},{Y},{Z}"
POINT_HEAD, POINT = "grasp,object,approach,x,y,z,active", f"1,cylinder,top,{X},{Y},{Z},1"
JOINT_HEAD, ANGLES = f"grasp,{','.join(ROBOT.joint_names)}", f"1{',0' * 16}"


def text_of(*rows):
    return "\n".join(rows) + "\n"


CONTACTS, JOINTS, POINTS = text_of(HEAD, ROW), text_of(JOINT_HEAD, ANGLES), text_of(POINT_HEAD, POINT)


def run(tmp_path, convert, first, joints=JOINTS, options=OPTIONS, **more):
    for name, content in (("c.csv", first), ("j.csv", joints)):
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    return convert(tmp_path / "c.csv", tmp_path / "sim.h5", joints=tmp_path / "j.csv", options=options, **more)


def message_of(tmp_path, *args, **more):
    with pytest.raises(ImportDataError) as caught:
        run(tmp_path, *args, **more)
    assert [path.name for path in tmp_path.iterdir() if path.suffix != ".csv"] == []
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value)
    assert "\n" not in str(copy)
    return str(copy).replace(f"{tmp_path}/", "")


def test_the_files_without_a_mistake_are_taken(tmp_path):
    run(tmp_path, import_contacts, CONTACTS)
    (tmp_path / "sim.h5").unlink()
    run(tmp_path, import_active, POINTS)
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()


CONTACT_MISTAKES = {
    "no column": (CONTACTS.replace(",z", ""), "c.csv: line 1: expected a column z"),
    "a typo": (CONTACTS.replace("approach", "aproach"), "line 1: expected known columns, found 'aproach'"),
    "twice": (CONTACTS.replace("time,x", "time,px,x"), "'x', a second column x"),
    "semicolons": (CONTACTS.replace(",", ";"), "line 1: expected columns separated by commas"),
    "a decimal comma": (CONTACTS.replace("0.5,", "0,5,", 1), "line 2: expected 7 values, found 8"),
    "a word": (CONTACTS.replace(",0.5,", ",soon,"), "line 2, column time: expected a finite number, found 'soon'"),
    "a NaN": (CONTACTS.replace(",0.5,", ",nan,"), "line 2, column time"),
    "no rows": (HEAD, "c.csv: file: expected rows"),
    "an empty file": ("", "line 1: expected a column grasp"),
    "no text": (b"grasp\xff\n", "UTF-8"),
    "half a quote": (text_of(HEAD, '"1,cylinder'), "c.csv: line 2: expected comma-separated values"),
    "an object": (CONTACTS.replace("cylinder", "cylindre"), "column object: expected an object whose shape is known"),
    "no name": (CONTACTS.replace("cylinder", ""), "line 2, column object: expected a name"),
    "two objects": (
        text_of(HEAD, ROW, ROW.replace("cylinder", "can")),
        "line 3, column object: expected the same object",
    ),
    "half a position": (CONTACTS.replace(str(X), ""), "line 2, column x: expected a finite number, found nothing"),
    "negative": (text_of(f"{HEAD},force", f"{ROW},-1"), "line 2, column force: expected newtons of 0 or more"),
    "both forces": (text_of(f"{HEAD},force,fx,fy,fz", f"{ROW},1,0,0,1"), "expected fx, fy, fz or force, found both"),
    "half a force": (text_of(f"{HEAD},fx,fy", f"{ROW},1,0"), "expected columns fx, fy, fz, found no fz"),
    "no force": (text_of(f"{HEAD},force", f"{ROW},"), "line 2, column force: expected a finite number, found nothing"),
    "no direction": (
        text_of(f"{HEAD},fx,fy,fz,nx,ny,nz", f"{ROW},1,0,0,0,0,0"),
        "line 2, column nx: expected a direction",
    ),
    "a board": (text_of(f"{HEAD},board", f"{ROW},plam"), "did you mean palm"),
    "a phase": (text_of(f"{HEAD},phase", f"{ROW},gripping"), "line 2, column phase: expected 0 to 4 or baseline"),
    "two phases": (text_of(f"{HEAD},phase", f"{ROW},1", f"{ROW},2"), "column phase: expected one phase at a time"),
    "a grasp": (CONTACTS.replace("\n1,", "\n7,"), "j.csv: grasp: expected rows of grasp '7'"),
    "an iteration": (text_of(f"{HEAD},iteration", f"{ROW},1.5"), "column iteration: expected an integer"),
    "millimetres": (CONTACTS.replace(f"{X},{Y},{Z}", "513,-23,260"), "line 2, column x: expected contacts of a grasp"),
}


@pytest.mark.parametrize("case", CONTACT_MISTAKES)
def test_mistakes_in_contact_points(tmp_path, case):
    text, said = CONTACT_MISTAKES[case]
    assert said in message_of(tmp_path, import_contacts, text)


JOINT_MISTAKES = {
    "a joint": (JOINTS.replace("ff_j2", "ff_j9"), "j.csv: line 1: expected known columns, found 'ff_j9'"),
    "a joint less": (text_of(JOINT_HEAD.replace(",th_j3", ""), ANGLES[:-2]), "expected a column th_j3"),
    "arm and wrist": (
        text_of(f"{JOINT_HEAD},elbow", f"{ANGLES},0"),
        "expected joints of the arm or a pose of the wrist, found both",
    ),
    "a second row": (text_of(JOINT_HEAD, ANGLES, ANGLES), "line 3, column grasp: expected one row for a grasp"),
    "times": (
        text_of(f"{JOINT_HEAD},time", f"{ANGLES},1", f"{ANGLES},0.5"),
        "line 3, column time: expected increasing times within a grasp",
    ),
    "another clock": (
        text_of(f"{JOINT_HEAD},time", f"{ANGLES},8", f"{ANGLES},9"),
        "expected times from 0.5 to 0.5 s for grasp '1', found 8 to 9 s",
    ),
    "other moments": (
        text_of(f"{JOINT_HEAD},time,phase", f"{ANGLES},0.4,1", f"{ANGLES},0.6,2"),
        "c.csv: line 2, column time: expected a time of",
    ),
    "half a pose": (text_of(f"{JOINT_HEAD},object_x", f"{ANGLES},0"), "found no object_y"),
    "a quaternion": (
        text_of(
            f"{JOINT_HEAD},{','.join(f'object_{p}' for p in ('x', 'y', 'z', 'qw', 'qx', 'qy', 'qz'))}",
            f"{ANGLES}{',0' * 7}",
        ),
        "line 2, column object_qw: expected a quaternion",
    ),
}


@pytest.mark.parametrize("case", JOINT_MISTAKES)
def test_mistakes_in_joint_angles(tmp_path, case):
    text, said = JOINT_MISTAKES[case]
    assert said in message_of(tmp_path, import_contacts, CONTACTS, text)


POINT_MISTAKES = {
    "off the taxels": (POINTS.replace(f"{X},", f"{X + 0.0012},"), "line 2, column x: expected a point within 1 mm"),
    "a taxel twice": (text_of(POINT_HEAD, POINT, POINT), "line 3, column x: expected each taxel once, found taxel 3"),
    "neither": (text_of(POINT_HEAD, POINT[:-1] + "2"), "line 2, column active: expected 0 or 1, found 2"),
}


@pytest.mark.parametrize("case", POINT_MISTAKES)
def test_mistakes_in_active_taxels(tmp_path, case):
    text, said = POINT_MISTAKES[case]
    assert said in message_of(tmp_path, import_active, text)


def test_points_without_times_need_a_hand_that_stands_still(tmp_path):
    joints = text_of(f"{JOINT_HEAD},time", f"{ANGLES},1", f"{ANGLES},2")
    assert "expected a column time, found none; j.csv has 2 times of grasp '1'" in message_of(
        tmp_path, import_active, POINTS, joints
    )


def test_a_dataset_without_a_baseline_is_refused(tmp_path):
    options = ImportOptions(object_poses=OPTIONS.object_poses, wrist_pose=WRIST)
    said = message_of(tmp_path, import_contacts, CONTACTS, options=options)
    assert (
        "expected 100 frames of phase 0 (baseline) in grasp '0001', found 0; taxels are active relative to a baseline"
        in said
    )
    assert "--baseline-frames 100" in said


def test_an_object_without_a_place_is_refused(tmp_path):
    options = ImportOptions(wrist_pose=WRIST, baseline_frames=100)
    said = message_of(tmp_path, import_contacts, CONTACTS, options=options)
    assert "expected the pose of 'cylinder'" in said
    assert "calibration" in said


def test_a_hand_without_an_arm_needs_the_wrist(tmp_path):
    options = ImportOptions(object_poses=OPTIONS.object_poses, baseline_frames=100)
    said = message_of(tmp_path, import_contacts, CONTACTS, options=options)
    assert "j.csv: line 1: expected 22 joints, or 16 joints and the pose of the wrist, found 16 joints only" in said


def test_mistakes_in_poses(tmp_path):
    (tmp_path / "c.csv").write_text(CONTACTS)
    head = "grasp,link,x,y,z,qw,qx,qy,qz"
    cases = [
        (
            text_of(head.replace(",link", ""), "1,0,0,0,1,0,0,0"),
            "expected a column link or a column board, found neither",
        ),
        (text_of(head, "1,palm,0,0,0,1,0,0,0"), "link: expected a row of th_distal, found none at 0 s of grasp '1'"),
        (text_of(head, *["1,palm,0,0,0,1,0,0,0"] * 2), "line 3, column link: expected each link once at a time"),
        (text_of(head.replace(",qz", ""), "1,palm,0,0,0,1,0,0"), "expected a column qz"),
    ]
    for text, said in cases:
        (tmp_path / "p.csv").write_text(text)
        with pytest.raises(ImportDataError) as caught:
            import_contacts(tmp_path / "c.csv", tmp_path / "sim.h5", poses=tmp_path / "p.csv", options=OPTIONS)
        assert said in str(caught.value)


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    with pytest.raises(ImportDataError, match=r"none\.csv: file: expected a CSV file, found no such file"):
        import_contacts(tmp_path / "none.csv", tmp_path / "sim.h5", joints=tmp_path / "j.csv", options=OPTIONS)
    with pytest.raises(ImportDataError, match="found a folder"):
        import_contacts(tmp_path, tmp_path / "sim.h5", joints=tmp_path / "j.csv", options=OPTIONS)


def test_misuse_of_the_functions_is_an_error_of_its_own(tmp_path):
    with pytest.raises(ValueError, match="threshold_m"):
        run(tmp_path, import_contacts, CONTACTS, threshold_m=0.0)
    with pytest.raises(ValueError, match="both or neither"):
        import_contacts(tmp_path / "c.csv", tmp_path / "sim.h5", options=OPTIONS)
