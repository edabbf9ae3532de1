"""Contact points and active taxels as CSV: round trips of our own simulator's grasps."""

import csv
from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import make_standing_pose, make_thesis_objects
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.kinematics import build_kinematics, compute_taxel_normals, compute_taxel_positions
from taxel.hand.transforms import to_quaternion
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.sim.closing import simulate_grasp
from taxel.sim.cone_sensing import NOMINAL_FORCE_N, ConeSensing, base_radius
from taxel.sim.importers.active_points import import_active
from taxel.sim.importers.gazebo_csv import default_threshold, distribute_forces, import_contacts
from taxel.sim.importers.options import ImportOptions
from taxel.sim.scene import build_scene
from taxel.sim.separation import separations

HAND = load_hand("allegro")
CYLINDER = make_thesis_objects()["cylinder"]
CONES = ConeSensing(base_radius(HAND), contact_offset_m=0.001)
SCENE = build_scene(HAND, CYLINDER, "palm")
STANDING = ImportOptions(object_poses={"cylinder": make_standing_pose()}, baseline_frames=100)


@cache
def motion():
    approach = next(a for a in make_thesis_approaches(withdraw_m=0.02) if (a.object, a.name) == ("cylinder", "side_1"))
    return simulate_grasp(SCENE, approach, Timeline(0.2, 2.0, 0.5, 0.3, 0.2))


def quaternion_row(transform):
    return [*transform[:3, 3].tolist(), *to_quaternion(transform).tolist()]


def write(path, header, rows):
    with path.open("w", newline="") as stream:
        csv.writer(stream).writerows([header, *rows])
    return path


def joints_file(path, with_phase=True, with_object=True):
    """The motion of the hand alone, with where the palm and the object were."""
    made = motion()
    header = ["grasp", "time", *(["phase"] if with_phase else []), *SCENE.joint_names]
    parts = ("x", "y", "z", "qw", "qx", "qy", "qz")
    header += [f"wrist_{part}" for part in parts] + ([f"object_{part}" for part in parts] if with_object else [])
    rows = []
    for k in range(len(made.time_s)):
        row = ["1", made.time_s[k], *([made.phase[k]] if with_phase else []), *made.joint_angles[k]]
        row += quaternion_row(made.link_poses[k, 0])
        rows.append(row + (quaternion_row(made.object_pose[k]) if with_object else []))
    return write(path, header, rows)


def contact_rows(points, **more):
    """points: frame [c] and position [c, 3]."""
    frame, position = points
    return [
        ["1", "cylinder", "side_1", motion().time_s[k], *xyz, *(values[i] for values in more.values())]
        for i, (k, xyz) in enumerate(zip(frame, position, strict=True))
    ]


def contacts_file(path, points, **more):
    return write(path, ["grasp", "object", "approach", "time", "x", "y", "z", *more], contact_rows(points, **more))


def tips():
    """The cones' tips that touch, as the thesis's simulator would report them."""
    made = motion()
    frame, taxel = np.nonzero(CONES.tips_in_contact(HAND, CYLINDER.shape, made.sensor_poses, made.object_pose))
    position = compute_taxel_positions(HAND, made.sensor_poses) + 0.001 * compute_taxel_normals(HAND, made.sensor_poses)
    return frame, position[frame, taxel]


def test_contact_points_of_the_simulator_activate_the_same_taxels_as_cone_sensing(tmp_path):
    made = motion()
    engine = made.contacts.sample, made.contacts.position
    points = tuple(np.concatenate(pair) for pair in zip(tips(), engine, strict=True))
    expected = CONES.active(HAND, CYLINDER.shape, made.sensor_poses, made.object_pose, engine)
    report = import_contacts(
        contacts_file(tmp_path / "contacts.csv", points),
        tmp_path / "sim.h5",
        joints=joints_file(tmp_path / "joints.csv"),
        options=STANDING,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        grasp = data["0001"]
        own = slice(report.added_frames, None)
        assert expected.sum() > 100
        np.testing.assert_array_equal(grasp.contact_force[own], np.where(expected, NOMINAL_FORCE_N, 0.0))
        np.testing.assert_array_equal(grasp.phase[own], made.phase)
        np.testing.assert_allclose(grasp.timestamp[own], made.time_s)
        geometry = separations(HAND, CYLINDER.shape, made.sensor_poses, made.object_pose)
        np.testing.assert_allclose(grasp.separation[own], geometry, atol=1e-8)
        active, known = grasp.active_taxels()
        hold = made.phase == Phase.HOLD
        np.testing.assert_array_equal(active, expected[hold].mean(axis=0) > 0.15)
        assert known.all()
        assert np.allclose(grasp.object_pose, make_standing_pose())
    assert report.contacts == len(points[0])


def test_added_baseline_frames_come_before_and_carry_nothing(tmp_path):
    report = import_contacts(
        contacts_file(tmp_path / "contacts.csv", tips()),
        tmp_path / "sim.h5",
        joints=joints_file(tmp_path / "joints.csv"),
        options=STANDING,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        grasp = data["0001"]
        assert report.added_frames == 100 - (motion().phase == 0).sum()
        assert (grasp.phase == 0).sum() == 100
        assert not grasp.contact_force[: report.added_frames].any()
        assert (grasp.separation[: report.added_frames] == 0.05).all()
        assert np.allclose(np.diff(grasp.timestamp), 0.05)
        assert np.isfinite(grasp.baseline()).all()


def test_given_forces_are_shared_out_and_none_is_lost(tmp_path):
    made = motion()
    frame, position = tips()
    rng = np.random.default_rng(5)
    normal, size = rng.normal(size=(len(frame), 3)), rng.uniform(0.1, 2.0, len(frame))
    force = (
        3.0 * size[:, None] * normal / np.linalg.norm(normal, axis=1)[:, None]
    )  # along 3 n: the normal need not be 1
    columns = {f"n{a}": 3 * normal[:, i] for i, a in enumerate("xyz")}
    columns |= {f"f{a}": force[:, i] for i, a in enumerate("xyz")}
    report = import_contacts(
        contacts_file(tmp_path / "contacts.csv", (frame, position), **columns),
        tmp_path / "sim.h5",
        joints=joints_file(tmp_path / "joints.csv"),
        options=STANDING,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        found = data["0001"].contact_force[report.added_frames :]
    wanted = np.bincount(frame, 3.0 * size, len(made.time_s))
    np.testing.assert_allclose(found.sum(axis=1), wanted, rtol=1e-9, atol=1e-12)
    assert report.far_contacts == 0


def test_shares_fall_with_the_distance():
    gap = np.array([[0.0, 0.001, 0.002, 0.003]])
    np.testing.assert_allclose(distribute_forces(gap, 0.002, np.array([3.0])), [2.0, 1.0, 0.0, 0.0], atol=1e-5)
    np.testing.assert_allclose(distribute_forces(gap[:, 2:], 0.002, np.array([3.0])), [3.0, 0.0])
    assert distribute_forces(gap[:, 3:], 0.002, np.array([3.0])) == [0.0]
    assert distribute_forces(gap, 0.002, None).tolist() == [2.0, 2.0, 2.0, 0.0]


def test_a_contact_beyond_the_threshold_is_felt_by_none_and_counted(tmp_path):
    frame, position = tips()
    position = position.copy()
    position[0, 2] += 0.3
    report = import_contacts(
        contacts_file(tmp_path / "contacts.csv", (frame, position), force=np.full(len(frame), 1.5)),
        tmp_path / "sim.h5",
        joints=joints_file(tmp_path / "joints.csv"),
        options=STANDING,
    )
    assert (report.far_contacts, report.far_force_n) == (1, 1.5)


def test_a_contact_that_names_its_board_is_felt_there_only(tmp_path):
    made = motion()
    frame, position = tips()
    other = np.full(len(frame), "palm")
    report = import_contacts(
        contacts_file(tmp_path / "contacts.csv", (frame, position), board=other),
        tmp_path / "sim.h5",
        joints=joints_file(tmp_path / "joints.csv"),
        options=STANDING,
    )
    palm = HAND.get_slice(HAND.find_board("palm").address)
    centres = compute_taxel_positions(HAND, made.sensor_poses)[frame, palm]
    near = np.linalg.norm(centres - position[:, None], axis=2).min(axis=1) <= default_threshold(HAND)
    assert report.far_contacts == len(frame) - near.sum()


def test_without_phases_all_contacts_are_of_the_closed_hand(tmp_path):
    made = motion()
    frame, position = tips()
    end = int(np.flatnonzero(made.phase == Phase.HOLD)[-1])
    report = import_contacts(
        contacts_file(tmp_path / "contacts.csv", (frame[frame == end], position[frame == end])),
        tmp_path / "sim.h5",
        joints=joints_file(tmp_path / "joints.csv", with_phase=False),
        options=STANDING,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        assert data["0001"].phase.tolist() == [0] * 100 + [2]
        expected = CONES.active(HAND, CYLINDER.shape, made.sensor_poses, made.object_pose)[end]
        np.testing.assert_array_equal(data["0001"].active_taxels()[0], expected)
    assert report.frames == 101


def test_rows_without_a_position_are_frames_without_contact(tmp_path):
    made = motion()
    header = ["grasp", "object", "approach", "time", "phase", "x", "y", "z"]
    frame, position = tips()
    rows = [["1", "cylinder", "side_1", t, int(p), "", "", ""] for t, p in zip(made.time_s, made.phase, strict=True)]
    for k, xyz in zip(frame, position, strict=True):
        rows.append(["1", "cylinder", "side_1", made.time_s[k], int(made.phase[k]), *xyz])
    import_contacts(
        write(tmp_path / "contacts.csv", header, rows),
        tmp_path / "sim.h5",
        joints=joints_file(tmp_path / "joints.csv", with_phase=False),
        options=STANDING,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        own = data["0001"].contact_force[-len(made.time_s) :]
        np.testing.assert_array_equal(own.any(axis=1), np.isin(np.arange(len(own)), frame))


def test_poses_of_links_or_boards_do_as_well_as_joint_angles(tmp_path):
    made, parts = motion(), ("x", "y", "z", "qw", "qx", "qy", "qz")
    contacts = contacts_file(tmp_path / "contacts.csv", tips())
    links, boards = [], []
    for k, time in enumerate(made.time_s):
        for name, where in zip(SCENE.links, made.link_poses[k], strict=True):
            links.append(["1", time, made.phase[k], name, *quaternion_row(where)])
        for board, where in zip(HAND.boards, made.sensor_poses[k], strict=True):
            boards.append(["1", time, made.phase[k], board.name, *quaternion_row(where)])
    found = []
    for name, rows in (("link", links), ("board", boards)):
        poses = write(tmp_path / f"{name}.csv", ["grasp", "time", "phase", name, *parts], rows)
        import_contacts(contacts, tmp_path / f"{name}.h5", poses=poses, options=STANDING)
        with GraspDataset(tmp_path / f"{name}.h5") as data:
            data.check()
            np.testing.assert_allclose(data["0001"].sensor_pose_t[-len(made.time_s) :], made.sensor_poses, atol=1e-12)
            found.append(data["0001"].contact_force)
    np.testing.assert_array_equal(found[0], found[1])


def test_joints_of_the_whole_robot_put_the_world_into_its_base(tmp_path):
    kinematics = build_kinematics(HAND)
    rng = np.random.default_rng(11)
    angles = rng.uniform(0.0, 0.3, len(kinematics.robot.joint_names))
    joints = write(tmp_path / "j.csv", ["grasp", *kinematics.robot.joint_names], [["a", *angles]])
    sensors = kinematics.compute_sensor_poses(angles)
    item = sensors[0].copy()
    centre = compute_taxel_positions(HAND, sensors)[7]
    points = write(
        tmp_path / "p.csv", ["grasp", "object", "approach", "x", "y", "z"], [["a", "cylinder", "?", *centre]]
    )
    options = ImportOptions(object_poses={"cylinder": item}, baseline_frames=100)
    import_active(points, tmp_path / "sim.h5", joints=joints, options=options)
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        np.testing.assert_allclose(data["a"].sensor_pose, sensors, atol=1e-12)
        assert np.flatnonzero(data["a"].active_taxels()[0]).tolist() == [7]
        assert data["a"].joint_position.shape == (101, 22)


def test_the_hand_is_taken_between_its_recorded_moments(tmp_path):
    made = motion()
    joints = joints_file(tmp_path / "joints.csv", with_phase=False)
    end = int(np.flatnonzero(made.phase == Phase.HOLD)[-1])
    frame, position = tips()
    own = position[frame == end]
    rows = [["1", "cylinder", "side_1", made.time_s[end] - 0.0125, *xyz] for xyz in own]
    contacts = write(tmp_path / "c.csv", ["grasp", "object", "approach", "time", "x", "y", "z"], rows)
    import_contacts(contacts, tmp_path / "sim.h5", joints=joints, options=STANDING)
    with GraspDataset(tmp_path / "sim.h5") as data:
        expected = 0.25 * made.joint_angles[end - 1] + 0.75 * made.joint_angles[end]
        np.testing.assert_allclose(data["0001"].joint_position[-1], expected, atol=1e-12)


def test_lists_of_active_taxels_come_back(tmp_path):
    made = motion()
    end = int(np.flatnonzero(made.phase == Phase.HOLD)[-1])
    active = CONES.active(HAND, CYLINDER.shape, made.sensor_poses, made.object_pose)[end]
    rng = np.random.default_rng(3)
    centres = compute_taxel_positions(HAND, made.sensor_poses)[end] + rng.uniform(-2e-4, 2e-4, (HAND.n_taxels, 3))
    rows = [["g", "cylinder", "side_1", *centre, int(on)] for centre, on in zip(centres, active, strict=True)]
    points = write(tmp_path / "points.csv", ["Grasp", "object", "approach", "X", "y", "z", "activated"], rows)
    header = ["grasp", *SCENE.joint_names, *(f"wrist_{p}" for p in ("x", "y", "z", "qw", "qx", "qy", "qz"))]
    joints = [["g", *made.joint_angles[end], *quaternion_row(made.link_poses[end, 0])]]
    import_active(points, tmp_path / "sim.h5", joints=write(tmp_path / "j.csv", header, joints), options=STANDING)
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        np.testing.assert_array_equal(data["g"].active_taxels()[0], active)


def test_ids_of_grasps_sort_in_the_order_of_the_file(tmp_path):
    made = motion()
    end = int(np.flatnonzero(made.phase == Phase.HOLD)[-1])
    centre = compute_taxel_positions(HAND, made.sensor_poses)[end, 5]
    header = ["grasp", *SCENE.joint_names]
    for names, ids in ((("9", "10"), ("0009", "0010")), (("b", "a"), ("0001_b", "0002_a"))):
        points = write(
            tmp_path / "p.csv",
            ["grasp", "object", "approach", "iteration", "session", "x", "y", "z"],
            [[name, "cylinder", "side_1", k, 2, *centre] for k, name in enumerate(names)],
        )
        joints = write(tmp_path / "j.csv", header, [[name, *made.joint_angles[end]] for name in names])
        options = ImportOptions(
            object_poses={"cylinder": make_standing_pose()},
            wrist_pose=made.link_poses[end, 0],
            baseline_frames=100,
            overwrite=True,
        )
        import_active(points, tmp_path / "sim.h5", joints=joints, options=options)
        with GraspDataset(tmp_path / "sim.h5") as data:
            assert tuple(data.ids) == ids
            assert [(grasp.iteration, grasp.session) for grasp in data] == [(0, 2), (1, 2)]


def test_the_same_files_give_the_same_counts_and_another_seed_others(tmp_path):
    contacts, joints = contacts_file(tmp_path / "c.csv", tips()), joints_file(tmp_path / "j.csv")
    counts = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        options = ImportOptions(object_poses=STANDING.object_poses, baseline_frames=100, seed=seed)
        import_contacts(contacts, tmp_path / f"{name}.h5", joints=joints, options=options)
        with GraspDataset(tmp_path / f"{name}.h5") as data:
            counts.append(data["0001"].raw_counts)
    assert (counts[0] == counts[1]).all()
    assert (counts[0] != counts[2]).any()


def test_a_mistake_leaves_neither_a_file_nor_a_part_of_one(tmp_path):
    contacts = contacts_file(tmp_path / "c.csv", tips())
    joints = joints_file(tmp_path / "j.csv")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(ValueError, match="baseline"):
        import_contacts(contacts, tmp_path / "sim.h5", joints=joints, options=ImportOptions())
    assert sorted(tmp_path.iterdir()) == before
    (tmp_path / "sim.h5").write_bytes(b"mine")
    with pytest.raises(DatasetError, match=r"sim\.h5"):
        import_contacts(contacts, tmp_path / "sim.h5", joints=joints, options=STANDING)
    assert (tmp_path / "sim.h5").read_bytes() == b"mine"


def test_progress_is_told(tmp_path):
    told = []
    options = ImportOptions(
        object_poses=STANDING.object_poses, baseline_frames=100, progress=lambda *what: told.append(what)
    )
    contacts, joints = contacts_file(tmp_path / "c.csv", tips()), joints_file(tmp_path / "j.csv")
    import_contacts(contacts, tmp_path / "sim.h5", joints=joints, options=options)
    assert {what for what, _, _ in told} == {"reading c.csv", "reading j.csv", "grasps"}
    assert all(0 <= done <= of for _, done, of in told)
    assert told[-1] == ("grasps", 1, 1)


def test_a_hand_without_an_arm_stands_at_the_root_of_its_robot(tmp_path):
    plate = load_hand("flat8")
    kinematics = build_kinematics(plate)
    centre = compute_taxel_positions(plate, kinematics.compute_sensor_poses([0.1]))[3]
    points = write(
        tmp_path / "p.csv", ["grasp", "object", "approach", "x", "y", "z"], [["a", "cylinder", "?", *centre]]
    )
    joints = write(tmp_path / "j.csv", ["grasp", *kinematics.robot.joint_names], [["a", 0.1]])
    options = ImportOptions(plate, object_poses={"cylinder": make_standing_pose()}, baseline_frames=100)
    import_active(points, tmp_path / "sim.h5", joints=joints, options=options)
    with GraspDataset(tmp_path / "sim.h5") as data:
        assert np.flatnonzero(data["a"].active_taxels()[0]).tolist() == [3]
