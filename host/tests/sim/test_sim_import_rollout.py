"""Import of rollouts of a MuJoCo model: forces, object shapes, boards, grasps, and one-line errors."""

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest

from taxel.grasp.objects import ASSUMED_SIZES, make_thesis_objects
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.recording.grasp_dataset import GraspDataset
from taxel.sim import closing
from taxel.sim.contacts import StepContacts, compute_board_wrenches
from taxel.sim.importers.errors import ImportDataError
from taxel.sim.importers.mujoco_rollout import import_rollout
from taxel.sim.importers.options import ImportOptions
from taxel.sim.scene import build_scene
from taxel.sim.sensing import Sensing, sense

HAND = load_hand("allegro")
CYLINDER = make_thesis_objects(ASSUMED_SIZES)["cylinder"]
SCENE = build_scene(HAND, CYLINDER, "palm")
OPTIONS = ImportOptions(HAND, baseline_frames=100)
KNOWN_OBJECT = {"object": {"known": "cylinder"}}
PALM_SITE = {"boards": {"palm": {"site": "palm_site"}}}
STATES = ("qpos", "qvel", "mocap_pos", "mocap_quat", "qfrc_applied", "eq_active")


@cache
def record_simulated_grasp():
    """Simulate a grasp with the built-in simulator; return its motion and MuJoCo's states by array name."""
    states, original = {name: [] for name in STATES}, closing._Run._take_sample

    def recording_state(run):
        """Take a sample as the simulator does, and store MuJoCo's state at this time."""
        result = original(run)
        for name in STATES:
            states[name].append(getattr(run.data, name).copy())
        return result

    approach = next(a for a in make_thesis_approaches(withdraw_m=0.02) if (a.object, a.name) == ("cylinder", "side_1"))
    closing._Run._take_sample = recording_state
    try:
        motion = closing.simulate_grasp(SCENE, approach, Timeline(0.0, 2.0, 0.3, 0.3, 0.0))
    finally:
        closing._Run._take_sample = original
    arrays = {name: np.stack(values) for name, values in states.items()}
    assert len(arrays["qpos"]) == len(motion.time_s)
    return motion, arrays


def use_contacts_at_samples(motion):
    """Return the motion with the wrenches of the contacts at the samples, not of means over the preceding steps."""
    wrenches = []
    for k in range(len(motion.time_s)):
        at_sample, contacts = motion.contacts.sample == k, motion.contacts
        step = StepContacts(
            contacts.board[at_sample],
            contacts.position[at_sample],
            contacts.normal[at_sample],
            contacts.depth[at_sample],
            contacts.force[at_sample],
        )
        wrenches.append(compute_board_wrenches(step, motion.sensor_poses[k]))
    return replace(motion, wrench=np.stack(wrenches))


@pytest.fixture
def model(tmp_path):
    mujoco.mj_saveModel(SCENE.model, str(tmp_path / "model.mjb"))
    return tmp_path / "model.mjb"


@pytest.fixture
def states(tmp_path):
    """Write the recorded states of the simulated grasp, with labels, to an NPZ file."""
    motion, arrays = record_simulated_grasp()
    labels = {"time": motion.time_s, "phase": motion.phase, "approach": "side_1", "iteration": 3}
    np.savez(tmp_path / "states.npz", **arrays, **labels)
    return tmp_path / "states.npz"


def save_states(tmp_path, **arrays):
    """Write an NPZ file with the given arrays; return its path."""
    np.savez(tmp_path / "s.npz", **arrays)
    return tmp_path / "s.npz"


def test_a_rollout_of_the_built_in_scene_gives_the_forces_of_the_built_in_simulator(tmp_path, model, states):
    motion, _ = record_simulated_grasp()
    report = import_rollout(model, states, tmp_path / "sim.h5", model_map=KNOWN_OBJECT, options=OPTIONS)
    expected = sense(HAND, CYLINDER.shape, use_contacts_at_samples(motion), Sensing())
    assert (expected.contact_force > 0.05).sum() > 100
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        assert (data["0001"].object, data["0001"].approach, data["0001"].iteration) == ("cylinder", "side_1", 3)
        imported_frames = slice(report.added_frames, None)
        np.testing.assert_allclose(
            data["0001"].contact_force[imported_frames], expected.contact_force, rtol=0, atol=1e-6
        )
        np.testing.assert_allclose(data["0001"].separation[imported_frames], expected.separation, rtol=0, atol=1e-6)
        np.testing.assert_allclose(data["0001"].sensor_pose_t[imported_frames], motion.sensor_poses, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(data["0001"].phase[imported_frames], motion.phase)
        assert data["0001"].active_taxels()[0].sum() > 10
        assert data.sensor_model.layer == "uncoupled"
    assert report.contacts == len(motion.contacts.board)


def test_the_object_shape_of_the_model_gives_the_same_forces_as_the_known_shape(tmp_path, model, states):
    for name, parts in (("known", KNOWN_OBJECT), ("model", {})):
        import_rollout(model, states, tmp_path / f"{name}.h5", model_map=parts, options=OPTIONS)
    with GraspDataset(tmp_path / "known.h5") as known, GraspDataset(tmp_path / "model.h5") as model_shape:
        assert model_shape["0001"].object == "object"
        np.testing.assert_allclose(model_shape["0001"].contact_force, known["0001"].contact_force, atol=1e-6)
        np.testing.assert_allclose(model_shape["0001"].object_pose, known["0001"].object_pose, atol=1e-12)


@pytest.mark.parametrize("name", ["rectangular_prism", "triangular_prism"])
def test_vertices_of_mesh_objects_are_imported(tmp_path, name):
    item = make_thesis_objects(ASSUMED_SIZES)[name]
    scene = build_scene(HAND, item, "palm")
    mujoco.mj_saveModel(scene.model, str(tmp_path / "model.mjb"))
    states = save_states(tmp_path, qpos=np.tile(scene.model.qpos0, (2, 1)))
    import_rollout(tmp_path / "model.mjb", states, tmp_path / "sim.h5", options=OPTIONS)
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        vertices, expected_vertices = data.objects["object"].vertices, item.shape.mesh()[0]
        gap = np.linalg.norm(vertices[:, None] - expected_vertices[None], axis=2)
        assert gap.min(axis=0).max() < 1e-7
        assert gap.min(axis=1).max() < 1e-7


def test_boards_given_as_bodies_get_about_the_forces_of_boards_given_as_geoms(tmp_path, model, states):
    """A contact of a body with several boards belongs to the nearest board, so the forces agree only approximately."""
    links = {board.name: {"body": f"link:{board.link_name}"} for board in HAND.boards}
    for name, parts in (("geoms", KNOWN_OBJECT), ("bodies", {**KNOWN_OBJECT, "boards": links})):
        import_rollout(model, states, tmp_path / f"{name}.h5", model_map=parts, options=OPTIONS)
    with GraspDataset(tmp_path / "geoms.h5") as geoms, GraspDataset(tmp_path / "bodies.h5") as bodies:
        geom_force, body_force = geoms["0001"].contact_force.sum(axis=1), bodies["0001"].contact_force.sum(axis=1)
        assert geom_force.max() > 5
        np.testing.assert_allclose(geom_force, body_force, rtol=0.1, atol=0.3)


def test_simulating_with_recorded_controls_agrees_with_recorded_states_or_is_refused(tmp_path):
    text = make_small_model()
    (tmp_path / "m.xml").write_text(text)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    ctrl, qpos, time = np.linspace(0, 4, 50)[:, None], [], []
    for value in ctrl:
        qpos.append(data.qpos.copy())
        time.append(data.time)
        data.ctrl[:] = value
        mujoco.mj_step(model, data)
    controls = {"ctrl": ctrl, "time": np.array(time)}
    # Controls and the first state alone give the same contacts as controls with all states.
    for name, states in (("start", {"qpos": qpos[:1]}), ("all", {"qpos": np.array(qpos)})):
        states_file = save_states(tmp_path, **controls, **states)
        import_rollout(tmp_path / "m.xml", states_file, tmp_path / f"{name}.h5", model_map=PALM_SITE, options=OPTIONS)
    with GraspDataset(tmp_path / "start.h5") as start, GraspDataset(tmp_path / "all.h5") as all_states:
        np.testing.assert_array_equal(start["0001"].contact_force, all_states["0001"].contact_force)
        assert start["0001"].contact_force.max() > 0.05
        heights = start["0001"].sensor_pose_t[100:, 0, 2, 3]
        np.testing.assert_allclose(heights - heights[0], np.ravel(qpos)[: len(heights)], atol=1e-12)
    # States that differ from the simulation of the controls are refused; without this simulation they are accepted.
    drifted = np.array(qpos) + np.linspace(0, 0.01, 50)[:, None]
    with pytest.raises(ImportDataError, match=r"qpos\[\d+, 0\].*--forward"):
        import_rollout(
            tmp_path / "m.xml", save_states(tmp_path, **controls, qpos=drifted), tmp_path / "x.h5", options=OPTIONS
        )
    import_rollout(
        tmp_path / "m.xml",
        save_states(tmp_path, **controls, qpos=drifted),
        tmp_path / "x.h5",
        is_replayed=False,
        options=OPTIONS,
    )


def test_rows_are_divided_into_grasps_by_their_labels(tmp_path):
    (tmp_path / "m.xml").write_text(make_small_model())
    states = save_states(
        tmp_path, qpos=np.zeros((6, 1)), grasp=np.repeat([1, 2], 3), phase=["closing", "hold", "release"] * 2, session=1
    )
    report = import_rollout(tmp_path / "m.xml", states, tmp_path / "sim.h5", options=OPTIONS)
    # Two grasps of three states each; the import adds 100 frames of the baseline to each grasp.
    assert (report.grasps, report.frames, report.added_frames) == (2, 206, 200)
    with GraspDataset(tmp_path / "sim.h5") as data:
        assert list(data.ids) == ["0001", "0002"]
        assert data["0002"].phase[-3:].tolist() == [Phase.CLOSING, Phase.HOLD, Phase.RELEASE]
        assert data["0002"].session == 1


def make_small_model(prefix="rh_", extra=""):
    """Return the MJCF of a plate with the palm as a site, which a motor pushes against a box; other links are far away.

    prefix: of the link names. extra: further MJCF elements of the world.
    """
    links = sorted({board.link_name for board in HAND.boards} - {"palm"})
    other_bodies = "".join(f'<body name="{prefix}{link}" pos="0 {k + 1} -3"/>' for k, link in enumerate(links))
    return f"""<mujoco><option timestep="0.002" gravity="0 0 0"/><worldbody>{other_bodies}
<body name="{prefix}palm" pos="0 0 -0.0012"><joint name="up" type="slide" axis="0 0 1" damping="20"/>
<geom type="box" size="0.06 0.06 0.0005" pos="0 0 0.0005" mass="0.5"/>
<site name="palm_site" pos="0 0 0" quat="1 0 0 0"/></body>
<body name="object"><geom type="box" size="0.015 0.015 0.02" pos="0 0 0.02"/></body>{extra}
</worldbody><actuator><motor joint="up"/></actuator></mujoco>"""


def read_import_error(tmp_path, text=None, parts=None, **states):
    """Return the one-line message of an import that fails.

    text: MJCF of the model; None: the small model. parts: model map. states: arrays of the states; None removes one.
    """
    (tmp_path / "m.xml").write_text(make_small_model() if text is None else text)
    arrays = {"qpos": np.zeros((3, 1))} | states
    path = save_states(tmp_path, **{name: value for name, value in arrays.items() if value is not None})
    with pytest.raises(ImportDataError) as caught:
        import_rollout(tmp_path / "m.xml", path, tmp_path / "sim.h5", model_map=parts, options=OPTIONS)
    assert not (tmp_path / "sim.h5").exists()
    message = str(caught.value)
    assert "\n" not in message
    return message


INVALID_INPUTS = [  # (case, arguments of read_import_error, expected part of the error)
    ("missing body", {"text": make_small_model().replace("rh_th_distal", "rh_th_dista")}, "rh_th_dista"),
    ("model without boards", {"text": "<mujoco><worldbody><body name='object'/></worldbody></mujoco>"}, "boards"),
    ("unknown site", {"parts": {"boards": {"palm": "plam_site"}}}, "did you mean palm_site"),
    ("unsupported element", {"parts": {"boards": {"palm": {"joint": "up"}}}}, "geom, body or site"),
    ("unknown board", {"parts": {"boards": {"plam": "palm_site"}}}, "did you mean palm"),
    ("unknown key", {"parts": {"board": {}}}, "boards"),
    ("number instead of a table", {"parts": {"boards": 3}}, "a table"),
    ("unknown object body", {"parts": {"object": {"body": "objet"}}}, "did you mean object"),
    ("unknown known shape", {"parts": {"object": {"known": "cylindre"}}}, "did you mean cylinder"),
    (
        "unsupported sphere",
        {"text": make_small_model().replace('type="box" size="0.015 0.015 0.02"', 'type="sphere" size="0.1"')},
        "sphere",
    ),
    ("not MJCF", {"text": "<mujoco><worldbody>"}, "m.xml"),
    ("qpos missing", {"qpos": None}, "qpos: expected an array [T, 1]"),
    ("qpos of another model", {"qpos": np.zeros((3, 7))}, "qpos: expected numbers [T, 1]"),
    ("NaN", {"qpos": np.array([[0.0], [np.nan], [0.0]])}, "nan at [1, 0]"),
    ("unknown array", {"qpso": np.zeros(3)}, "did you mean qpos"),
    ("qvel too short", {"qvel": np.zeros((2, 1))}, "qvel: expected 3 rows"),
    ("decreasing times", {"time": np.array([0.0, 2.0, 1.0])}, "time[2]"),
    ("unknown phase", {"phase": ["hold", "hlod", "hold"]}, "phase[1]: expected 0 to 4"),
    ("rows of a grasp not contiguous", {"grasp": ["a", "b", "a"]}, "grasp[2]"),
    ("session not an integer", {"session": ["one", "one", "one"]}, "session[0]"),
    ("labels of two dimensions", {"grasp": np.zeros((3, 2))}, "grasp: expected a name"),
    ("array of Python objects", {"grasp": np.array([None, 1, 2], dtype=object)}, "plain arrays"),
]


@pytest.mark.parametrize(("case", "changes", "message"), INVALID_INPUTS, ids=[case[0] for case in INVALID_INPUTS])
def test_each_error_gives_one_line_that_names_its_location(tmp_path, case, changes, message):
    assert message in read_import_error(tmp_path, **changes)


def test_the_pose_of_a_site_is_the_pose_of_its_bracket(tmp_path):
    (tmp_path / "m.xml").write_text(make_small_model())
    states = save_states(tmp_path, qpos=np.array([[0.001], [0.0015]]))
    import_rollout(tmp_path / "m.xml", states, tmp_path / "sim.h5", model_map=PALM_SITE, options=OPTIONS)
    with GraspDataset(tmp_path / "sim.h5") as data:
        expected = np.eye(4)
        expected[2, 3] = 0.0015 - 0.0012  # the palm starts 1.2 mm below the origin; the last state moves it by 1.5 mm
        np.testing.assert_allclose(data["0001"].sensor_pose[0], expected, atol=1e-12)


def test_a_rollout_without_baseline_frames_is_refused(tmp_path):
    (tmp_path / "m.xml").write_text(make_small_model())
    with pytest.raises(ImportDataError, match=r"100 frames of phase 0.*--baseline-frames"):
        import_rollout(tmp_path / "m.xml", save_states(tmp_path, qpos=np.zeros((3, 1))), tmp_path / "sim.h5")
