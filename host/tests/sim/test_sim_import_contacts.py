"""Import of contact points and active taxels from CSV files, compared with a grasp of the built-in simulator."""

import csv
from functools import cache

import numpy as np
import pytest

from taxel.grasp.objects import ASSUMED_SIZES, make_standing_pose, make_thesis_objects
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.kinematics import build_kinematics, compute_taxel_normals, compute_taxel_positions
from taxel.hand.transforms import to_quaternion
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.sim.closing import simulate_grasp
from taxel.sim.cone_sensing import NOMINAL_FORCE_N, ConeSensing, compute_base_radius
from taxel.sim.importers.active_points import import_active
from taxel.sim.importers.gazebo_csv import compute_default_threshold, distribute_forces, import_contacts
from taxel.sim.importers.options import ImportOptions
from taxel.sim.scene import build_scene
from taxel.sim.separation import MISS_M, compute_separations

POSE_COLUMNS = ("x", "y", "z", "qw", "qx", "qy", "qz")
HAND = load_hand("allegro")
CYLINDER = make_thesis_objects(ASSUMED_SIZES)["cylinder"]
CONES = ConeSensing(compute_base_radius(HAND), contact_offset_m=0.001)
SCENE = build_scene(HAND, CYLINDER, "palm")
STANDING_OPTIONS = ImportOptions(HAND, object_poses={"cylinder": make_standing_pose()}, baseline_frames=100)


@cache
def simulate_motion():
    """Simulate a short grasp of the cylinder."""
    approach = next(a for a in make_thesis_approaches(withdraw_m=0.02) if (a.object, a.name) == ("cylinder", "side_1"))
    return simulate_grasp(SCENE, approach, Timeline(0.2, 2.5, 0.7, 0.3, 0.2))


def make_pose_row(transform):
    """Return position and quaternion (w, x, y, z) of a transform as a list."""
    return [*transform[:3, 3].tolist(), *to_quaternion(transform).tolist()]


def write_csv(path, header, rows):
    """Write a CSV file with a header line; return its path."""
    with path.open("w", newline="") as stream:
        csv.writer(stream).writerows([header, *rows])
    return path


def write_joints_file(path, with_phase=True, with_object=True):
    """Write the joint angles and wrist poses of the motion, optionally with phases and object poses."""
    motion = simulate_motion()
    header = ["grasp", "time", *(["phase"] if with_phase else []), *SCENE.joint_names]
    header += [f"wrist_{part}" for part in POSE_COLUMNS] + (
        [f"object_{part}" for part in POSE_COLUMNS] if with_object else []
    )
    rows = []
    for k in range(len(motion.time_s)):
        row = ["1", motion.time_s[k], *([motion.phase[k]] if with_phase else []), *motion.joint_angles[k]]
        row += make_pose_row(motion.link_poses[k, 0])
        rows.append(row + (make_pose_row(motion.object_pose[k]) if with_object else []))
    return write_csv(path, header, rows)


def make_contact_rows(points, **extra_columns):
    """Make one row per contact. points: time frame [c] and position [c, 3]. extra_columns: values [c] by name."""
    frame, position = points
    return [
        [
            "1",
            "cylinder",
            "side_1",
            simulate_motion().time_s[k],
            *xyz,
            *(values[i] for values in extra_columns.values()),
        ]
        for i, (k, xyz) in enumerate(zip(frame, position, strict=True))
    ]


def write_contacts_file(path, points, **extra_columns):
    """Write a file of contact points with the rows of `make_contact_rows`; return its path."""
    return write_csv(
        path,
        ["grasp", "object", "approach", "time", "x", "y", "z", *extra_columns],
        make_contact_rows(points, **extra_columns),
    )


def find_tip_contacts():
    """Find the touching cone tips, as in the simulator of the thesis: time frames [c] and positions [c, 3]."""
    motion = simulate_motion()
    frame, taxel = np.nonzero(CONES.find_touching_tips(HAND, CYLINDER.shape, motion.sensor_poses, motion.object_pose))
    position = compute_taxel_positions(HAND, motion.sensor_poses) + 0.001 * compute_taxel_normals(
        HAND, motion.sensor_poses
    )
    return frame, position[frame, taxel]


def test_contact_points_of_the_simulator_activate_the_same_taxels_as_cone_sensing(tmp_path):
    motion = simulate_motion()
    engine = motion.contacts.sample, motion.contacts.position
    points = tuple(np.concatenate(pair) for pair in zip(find_tip_contacts(), engine, strict=True))
    expected = CONES.find_active(HAND, CYLINDER.shape, motion.sensor_poses, motion.object_pose, engine)
    report = import_contacts(
        write_contacts_file(tmp_path / "contacts.csv", points),
        tmp_path / "sim.h5",
        joints=write_joints_file(tmp_path / "joints.csv"),
        options=STANDING_OPTIONS,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        grasp = data["0001"]
        imported_frames = slice(report.added_frames, None)
        assert expected.sum() > 100
        np.testing.assert_array_equal(grasp.contact_force[imported_frames], np.where(expected, NOMINAL_FORCE_N, 0.0))
        np.testing.assert_array_equal(grasp.phase[imported_frames], motion.phase)
        np.testing.assert_allclose(grasp.timestamp[imported_frames], motion.time_s)
        geometry = compute_separations(HAND, CYLINDER.shape, motion.sensor_poses, motion.object_pose)
        np.testing.assert_allclose(grasp.separation[imported_frames], geometry, atol=1e-8)
        active, is_known = grasp.active_taxels()
        hold = motion.phase == Phase.HOLD
        # A taxel is active if its mean signal in hold exceeds 150 counts. A touched taxel has a signal of 1048 counts.
        # It is therefore active if it is touched in a share of more than 150 / 1048 = 0.143 of the frames.
        np.testing.assert_array_equal(active, expected[hold].mean(axis=0) > 0.15)
        assert is_known.all()
        assert np.allclose(grasp.object_pose, make_standing_pose())
    assert report.contacts == len(points[0])


def test_added_baseline_frames_precede_the_grasp_without_force(tmp_path):
    report = import_contacts(
        write_contacts_file(tmp_path / "contacts.csv", find_tip_contacts()),
        tmp_path / "sim.h5",
        joints=write_joints_file(tmp_path / "joints.csv"),
        options=STANDING_OPTIONS,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        grasp = data["0001"]
        assert report.added_frames == 100 - (simulate_motion().phase == Phase.BASELINE).sum()
        assert (grasp.phase == Phase.BASELINE).sum() == 100
        assert not grasp.contact_force[: report.added_frames].any()
        assert (grasp.separation[: report.added_frames] == MISS_M).all()
        assert np.allclose(np.diff(grasp.timestamp), 0.05)
        assert np.isfinite(grasp.baseline()).all()


def test_the_sum_of_the_taxel_forces_equals_the_given_contact_forces(tmp_path):
    motion = simulate_motion()
    frame, position = find_tip_contacts()
    rng = np.random.default_rng(5)
    normal, magnitude_n = rng.normal(size=(len(frame), 3)), rng.uniform(0.3, 6.0, len(frame))
    force = magnitude_n[:, None] * normal / np.linalg.norm(normal, axis=1)[:, None]
    columns = {f"n{axis}": 3 * normal[:, i] for i, axis in enumerate("xyz")}  # normals of any length are accepted
    columns |= {f"f{axis}": force[:, i] for i, axis in enumerate("xyz")}
    report = import_contacts(
        write_contacts_file(tmp_path / "contacts.csv", (frame, position), **columns),
        tmp_path / "sim.h5",
        joints=write_joints_file(tmp_path / "joints.csv"),
        options=STANDING_OPTIONS,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        taxel_forces = data["0001"].contact_force[report.added_frames :]
    expected_sums = np.bincount(frame, magnitude_n, len(motion.time_s))
    np.testing.assert_allclose(taxel_forces.sum(axis=1), expected_sums, rtol=1e-9, atol=1e-12)
    assert report.far_contacts == 0


def test_the_share_of_a_taxel_decreases_linearly_with_its_distance():
    distance, force = np.array([[0.0, 0.001, 0.002, 0.003]]), np.array([3.0])
    np.testing.assert_allclose(distribute_forces(distance, 0.002, force), [2.0, 1.0, 0.0, 0.0], atol=1e-5)


def test_a_taxel_exactly_at_the_threshold_gets_the_force_that_no_nearer_taxel_bears():
    distance, force = np.array([[0.002, 0.003]]), np.array([3.0])
    np.testing.assert_allclose(distribute_forces(distance, 0.002, force), [3.0, 0.0])
    assert distribute_forces(distance[:, 1:], 0.002, force) == [0.0]


def test_contacts_without_forces_give_the_nominal_force_to_each_taxel_within_the_threshold():
    distance = np.array([[0.0, 0.001, 0.002, 0.003]])
    expected = [NOMINAL_FORCE_N, NOMINAL_FORCE_N, NOMINAL_FORCE_N, 0.0]
    assert distribute_forces(distance, 0.002, None).tolist() == expected


def test_a_contact_beyond_the_threshold_loads_no_taxel_and_is_counted(tmp_path):
    force_n = 1.5
    frame, position = find_tip_contacts()
    position = position.copy()
    position[0, 2] += 0.3
    report = import_contacts(
        write_contacts_file(tmp_path / "contacts.csv", (frame, position), force=np.full(len(frame), force_n)),
        tmp_path / "sim.h5",
        joints=write_joints_file(tmp_path / "joints.csv"),
        options=STANDING_OPTIONS,
    )
    assert (report.far_contacts, report.far_force_n) == (1, force_n)
    with GraspDataset(tmp_path / "sim.h5") as data:
        assert data["0001"].contact_force.sum() == pytest.approx(force_n * (len(frame) - 1))


def test_a_contact_with_a_board_name_loads_only_taxels_of_this_board(tmp_path):
    motion = simulate_motion()
    frame, position = find_tip_contacts()
    board_names = np.full(len(frame), "palm")
    report = import_contacts(
        write_contacts_file(tmp_path / "contacts.csv", (frame, position), board=board_names),
        tmp_path / "sim.h5",
        joints=write_joints_file(tmp_path / "joints.csv"),
        options=STANDING_OPTIONS,
    )
    palm = HAND.get_slice(HAND.find_board("palm").address)
    centres = compute_taxel_positions(HAND, motion.sensor_poses)[frame, palm]
    is_near = np.linalg.norm(centres - position[:, None], axis=2).min(axis=1) <= compute_default_threshold(HAND)
    assert report.far_contacts == len(frame) - is_near.sum()


def test_frames_of_a_file_without_phases_have_the_phase_hold(tmp_path):
    motion = simulate_motion()
    frame, position = find_tip_contacts()
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    report = import_contacts(
        write_contacts_file(tmp_path / "contacts.csv", (frame[frame == end], position[frame == end])),
        tmp_path / "sim.h5",
        joints=write_joints_file(tmp_path / "joints.csv", with_phase=False),
        options=STANDING_OPTIONS,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        assert data["0001"].phase.tolist() == [Phase.BASELINE] * 100 + [Phase.HOLD]
        expected = CONES.find_active(HAND, CYLINDER.shape, motion.sensor_poses, motion.object_pose)[end]
        np.testing.assert_array_equal(data["0001"].active_taxels()[0], expected)
    assert report.frames == 101


def test_rows_without_a_position_are_frames_without_contact(tmp_path):
    motion = simulate_motion()
    header = ["grasp", "object", "approach", "time", "phase", "x", "y", "z"]
    frame, position = find_tip_contacts()
    rows = [
        ["1", "cylinder", "side_1", t, int(p), "", "", ""] for t, p in zip(motion.time_s, motion.phase, strict=True)
    ]
    for k, xyz in zip(frame, position, strict=True):
        rows.append(["1", "cylinder", "side_1", motion.time_s[k], int(motion.phase[k]), *xyz])
    import_contacts(
        write_csv(tmp_path / "contacts.csv", header, rows),
        tmp_path / "sim.h5",
        joints=write_joints_file(tmp_path / "joints.csv", with_phase=False),
        options=STANDING_OPTIONS,
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        forces = data["0001"].contact_force[-len(motion.time_s) :]
        np.testing.assert_array_equal(forces.any(axis=1), np.isin(np.arange(len(forces)), frame))


def test_poses_of_links_and_of_boards_give_equal_forces(tmp_path):
    motion = simulate_motion()
    contacts = write_contacts_file(tmp_path / "contacts.csv", find_tip_contacts())
    links, boards = [], []
    for k, time in enumerate(motion.time_s):
        for name, pose in zip(SCENE.links, motion.link_poses[k], strict=True):
            links.append(["1", time, motion.phase[k], name, *make_pose_row(pose)])
        for board, pose in zip(HAND.boards, motion.sensor_poses[k], strict=True):
            boards.append(["1", time, motion.phase[k], board.name, *make_pose_row(pose)])
    forces = []
    for name, rows in (("link", links), ("board", boards)):
        poses = write_csv(tmp_path / f"{name}.csv", ["grasp", "time", "phase", name, *POSE_COLUMNS], rows)
        import_contacts(contacts, tmp_path / f"{name}.h5", poses=poses, options=STANDING_OPTIONS)
        with GraspDataset(tmp_path / f"{name}.h5") as data:
            data.check()
            np.testing.assert_allclose(
                data["0001"].sensor_pose_t[-len(motion.time_s) :], motion.sensor_poses, atol=1e-12
            )
            forces.append(data["0001"].contact_force)
    np.testing.assert_array_equal(forces[0], forces[1])


def test_with_joints_of_arm_and_hand_the_world_frame_is_the_robot_base(tmp_path):
    kinematics = build_kinematics(HAND)
    rng = np.random.default_rng(11)
    angles = rng.uniform(0.0, 0.3, len(kinematics.robot.joint_names))
    joints = write_csv(tmp_path / "j.csv", ["grasp", *kinematics.robot.joint_names], [["a", *angles]])
    sensors = kinematics.compute_sensor_poses(angles)
    object_pose = sensors[0].copy()
    taxel = 7
    centre = compute_taxel_positions(HAND, sensors)[taxel]
    points = write_csv(
        tmp_path / "p.csv", ["grasp", "object", "approach", "x", "y", "z"], [["a", "cylinder", "?", *centre]]
    )
    options = ImportOptions(HAND, object_poses={"cylinder": object_pose}, baseline_frames=100)
    import_active(points, tmp_path / "sim.h5", joints=joints, options=options)
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        np.testing.assert_allclose(data["a"].sensor_pose, sensors, atol=1e-12)
        assert np.flatnonzero(data["a"].active_taxels()[0]).tolist() == [taxel]
        assert data["a"].joint_position.shape == (101, 22)  # 100 baseline frames and one grasp frame; 6 + 16 joints


def test_joint_angles_are_interpolated_between_recorded_times(tmp_path):
    motion = simulate_motion()
    joints = write_joints_file(tmp_path / "joints.csv", with_phase=False)
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    frame, position = find_tip_contacts()
    end_positions = position[frame == end]
    time_s = motion.time_s[end] - 0.0125  # at three quarters of the 50 ms between the last two samples of hold
    rows = [["1", "cylinder", "side_1", time_s, *xyz] for xyz in end_positions]
    contacts = write_csv(tmp_path / "c.csv", ["grasp", "object", "approach", "time", "x", "y", "z"], rows)
    import_contacts(contacts, tmp_path / "sim.h5", joints=joints, options=STANDING_OPTIONS)
    with GraspDataset(tmp_path / "sim.h5") as data:
        expected = 0.25 * motion.joint_angles[end - 1] + 0.75 * motion.joint_angles[end]
        np.testing.assert_allclose(data["0001"].joint_position[-1], expected, atol=1e-12)


def test_active_taxels_are_imported_by_their_positions(tmp_path):
    motion = simulate_motion()
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    active = CONES.find_active(HAND, CYLINDER.shape, motion.sensor_poses, motion.object_pose)[end]
    rng = np.random.default_rng(3)
    centres = compute_taxel_positions(HAND, motion.sensor_poses)[end] + rng.uniform(-2e-4, 2e-4, (HAND.n_taxels, 3))
    rows = [
        ["g", "cylinder", "side_1", *centre, int(is_active)] for centre, is_active in zip(centres, active, strict=True)
    ]
    points = write_csv(tmp_path / "points.csv", ["Grasp", "object", "approach", "X", "y", "z", "activated"], rows)
    header = ["grasp", *SCENE.joint_names, *(f"wrist_{column}" for column in POSE_COLUMNS)]
    joints = [["g", *motion.joint_angles[end], *make_pose_row(motion.link_poses[end, 0])]]
    import_active(
        points, tmp_path / "sim.h5", joints=write_csv(tmp_path / "j.csv", header, joints), options=STANDING_OPTIONS
    )
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        np.testing.assert_array_equal(data["g"].active_taxels()[0], active)


def test_grasp_ids_sort_in_the_order_of_the_file(tmp_path):
    motion = simulate_motion()
    end = int(np.flatnonzero(motion.phase == Phase.HOLD)[-1])
    centre = compute_taxel_positions(HAND, motion.sensor_poses)[end, 5]
    header = ["grasp", *SCENE.joint_names]
    for names, ids in ((("9", "10"), ("0009", "0010")), (("b", "a"), ("0001_b", "0002_a"))):
        points = write_csv(
            tmp_path / "p.csv",
            ["grasp", "object", "approach", "iteration", "session", "x", "y", "z"],
            [[name, "cylinder", "side_1", k, 2, *centre] for k, name in enumerate(names)],
        )
        joints = write_csv(tmp_path / "j.csv", header, [[name, *motion.joint_angles[end]] for name in names])
        options = ImportOptions(
            HAND,
            object_poses={"cylinder": make_standing_pose()},
            wrist_pose=motion.link_poses[end, 0],
            baseline_frames=100,
            overwrite=True,
        )
        import_active(points, tmp_path / "sim.h5", joints=joints, options=options)
        with GraspDataset(tmp_path / "sim.h5") as data:
            assert tuple(data.ids) == ids
            assert [(grasp.iteration, grasp.session) for grasp in data] == [(0, 2), (1, 2)]


def test_equal_files_and_seeds_give_equal_counts_and_another_seed_differs(tmp_path):
    contacts, joints = (
        write_contacts_file(tmp_path / "c.csv", find_tip_contacts()),
        write_joints_file(tmp_path / "j.csv"),
    )
    counts = []
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        options = ImportOptions(HAND, object_poses=STANDING_OPTIONS.object_poses, baseline_frames=100, seed=seed)
        import_contacts(contacts, tmp_path / f"{name}.h5", joints=joints, options=options)
        with GraspDataset(tmp_path / f"{name}.h5") as data:
            counts.append(data["0001"].raw_counts)
    assert (counts[0] == counts[1]).all()
    assert (counts[0] != counts[2]).any()


def test_a_failed_import_creates_no_file_and_keeps_an_existing_one(tmp_path):
    contacts = write_contacts_file(tmp_path / "c.csv", find_tip_contacts())
    joints = write_joints_file(tmp_path / "j.csv")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(ValueError, match="baseline"):
        import_contacts(contacts, tmp_path / "sim.h5", joints=joints, options=ImportOptions(HAND))
    assert sorted(tmp_path.iterdir()) == before
    (tmp_path / "sim.h5").write_bytes(b"earlier content")
    with pytest.raises(DatasetError, match=r"sim\.h5"):
        import_contacts(contacts, tmp_path / "sim.h5", joints=joints, options=STANDING_OPTIONS)
    assert (tmp_path / "sim.h5").read_bytes() == b"earlier content"


def test_progress_names_each_step_and_ends_with_the_last_grasp(tmp_path):
    reports = []
    options = ImportOptions(
        HAND,
        object_poses=STANDING_OPTIONS.object_poses,
        baseline_frames=100,
        progress=lambda *report: reports.append(report),
    )
    contacts, joints = (
        write_contacts_file(tmp_path / "c.csv", find_tip_contacts()),
        write_joints_file(tmp_path / "j.csv"),
    )
    import_contacts(contacts, tmp_path / "sim.h5", joints=joints, options=options)
    assert {step for step, _, _ in reports} == {"reading c.csv", "reading j.csv", "grasps"}
    assert all(0 <= count <= total for _, count, total in reports)
    assert reports[-1] == ("grasps", 1, 1)


def test_a_hand_without_an_arm_is_placed_at_the_root_of_its_robot(tmp_path):
    plate = load_hand("flat8")
    kinematics = build_kinematics(plate)
    centre = compute_taxel_positions(plate, kinematics.compute_sensor_poses([0.1]))[3]
    points = write_csv(
        tmp_path / "p.csv", ["grasp", "object", "approach", "x", "y", "z"], [["a", "cylinder", "?", *centre]]
    )
    joints = write_csv(tmp_path / "j.csv", ["grasp", *kinematics.robot.joint_names], [["a", 0.1]])
    options = ImportOptions(plate, object_poses={"cylinder": make_standing_pose()}, baseline_frames=100)
    import_active(points, tmp_path / "sim.h5", joints=joints, options=options)
    with GraspDataset(tmp_path / "sim.h5") as data:
        assert np.flatnonzero(data["a"].active_taxels()[0]).tolist() == [3]
