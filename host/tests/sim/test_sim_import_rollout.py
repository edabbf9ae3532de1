"""Rollouts of a MuJoCo model: our own scene as a user's model gives what our own simulator finds."""

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest

from taxel.grasp.objects import make_thesis_objects
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.recording.grasp_dataset import GraspDataset
from taxel.sim import closing
from taxel.sim.contacts import StepContacts, board_wrenches
from taxel.sim.importers.errors import ImportDataError
from taxel.sim.importers.mujoco_rollout import import_rollout
from taxel.sim.importers.options import ImportOptions
from taxel.sim.scene import build_scene
from taxel.sim.sensing import Sensing, sense

HAND = load_hand("allegro")
CYLINDER = make_thesis_objects()["cylinder"]
SCENE = build_scene(HAND, CYLINDER, "palm")
OPTIONS = ImportOptions(baseline_frames=100)
KNOWN = {"object": {"known": "cylinder"}}
SITE = {"boards": {"palm": {"site": "palm_site"}}}
STATES = ("qpos", "qvel", "mocap_pos", "mocap_quat", "qfrc_applied")


@cache
def recorded():
    """A grasp of our simulator, and MuJoCo's state at every sample."""
    states, original = {name: [] for name in STATES}, closing._Run._state

    def watched(run):
        result = original(run)
        for name in STATES:
            states[name].append(getattr(run.data, name).copy())
        return result

    approach = next(a for a in make_thesis_approaches(withdraw_m=0.02) if (a.object, a.name) == ("cylinder", "side_1"))
    closing._Run._state = watched
    try:
        motion = closing.simulate_grasp(SCENE, approach, Timeline(0.0, 2.0, 0.3, 0.3, 0.0))
    finally:
        closing._Run._state = original
    arrays = {name: np.stack(values) for name, values in states.items()}
    assert len(arrays["qpos"]) == len(motion.time_s)
    return motion, arrays


def at_samples(motion):
    """The motion with the wrenches of MuJoCo's contacts at the samples, not of the steps before them."""
    wrenches = []
    for k in range(len(motion.time_s)):
        own, c = motion.contacts.sample == k, motion.contacts
        step = StepContacts(c.board[own], c.position[own], c.normal[own], c.depth[own], c.force[own])
        wrenches.append(board_wrenches(step, motion.sensor_poses[k]))
    return replace(motion, wrench=np.stack(wrenches))


@pytest.fixture
def model(tmp_path):
    mujoco.mj_saveModel(SCENE.model, str(tmp_path / "model.mjb"))
    return tmp_path / "model.mjb"


@pytest.fixture
def states(tmp_path):
    motion, arrays = recorded()
    labels = {"time": motion.time_s, "phase": motion.phase, "approach": "side_1", "iteration": 3}
    np.savez(tmp_path / "states.npz", **arrays, **labels)
    return tmp_path / "states.npz"


def saved(tmp_path, **arrays):
    np.savez(tmp_path / "s.npz", **arrays)
    return tmp_path / "s.npz"


def test_a_rollout_of_our_own_scene_gives_the_forces_of_our_own_simulator(tmp_path, model, states):
    motion, _ = recorded()
    report = import_rollout(model, states, tmp_path / "sim.h5", model_map=KNOWN, options=OPTIONS)
    expected = sense(HAND, CYLINDER.shape, at_samples(motion), Sensing())
    assert (expected.contact_force > 0.05).sum() > 100
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        assert (data["0001"].object, data["0001"].approach, data["0001"].iteration) == ("cylinder", "side_1", 3)
        own = slice(report.added_frames, None)
        np.testing.assert_allclose(data["0001"].contact_force[own], expected.contact_force, rtol=0, atol=1e-9)
        np.testing.assert_allclose(data["0001"].separation[own], expected.separation, rtol=0, atol=1e-9)
        np.testing.assert_allclose(data["0001"].sensor_pose_t[own], motion.sensor_poses, rtol=0, atol=1e-12)
        np.testing.assert_array_equal(data["0001"].phase[own], motion.phase)
        assert data["0001"].active_taxels()[0].sum() > 10
        assert data.sensor_model.layer == "uncoupled"
    assert report.contacts == len(motion.contacts.board)


def test_the_shape_of_the_model_does_as_well_as_the_known_one(tmp_path, model, states):
    for name, parts in (("known", KNOWN), ("own", {})):
        import_rollout(model, states, tmp_path / f"{name}.h5", model_map=parts, options=OPTIONS)
    with GraspDataset(tmp_path / "known.h5") as known, GraspDataset(tmp_path / "own.h5") as own:
        assert own["0001"].object == "object"
        np.testing.assert_allclose(own["0001"].contact_force, known["0001"].contact_force, atol=1e-6)
        np.testing.assert_allclose(own["0001"].object_pose, known["0001"].object_pose, atol=1e-12)


@pytest.mark.parametrize("name", ["rectangular_prism", "triangular_prism"])
def test_mesh_objects_keep_their_faces(tmp_path, name):
    item = make_thesis_objects()[name]
    scene = build_scene(HAND, item, "palm")
    mujoco.mj_saveModel(scene.model, str(tmp_path / "model.mjb"))
    states = saved(tmp_path, qpos=np.tile(scene.model.qpos0, (2, 1)))
    import_rollout(tmp_path / "model.mjb", states, tmp_path / "sim.h5", options=OPTIONS)
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        found, wanted = data.objects["object"].vertices, item.shape.mesh()[0]
        gap = np.linalg.norm(found[:, None] - wanted[None], axis=2)
        assert gap.min(axis=0).max() < 1e-7
        assert gap.min(axis=1).max() < 1e-7


def test_bodies_and_sites_find_the_contacts_that_geoms_do(tmp_path, model, states):
    """Boards on one body share its contacts out by nearness."""
    links = {board.name: {"body": f"link:{board.link_name}"} for board in HAND.boards}
    for name, parts in (("geoms", KNOWN), ("bodies", {**KNOWN, "boards": links})):
        import_rollout(model, states, tmp_path / f"{name}.h5", model_map=parts, options=OPTIONS)
    with GraspDataset(tmp_path / "geoms.h5") as geoms, GraspDataset(tmp_path / "bodies.h5") as bodies:
        a, b = geoms["0001"].contact_force.sum(axis=1), bodies["0001"].contact_force.sum(axis=1)
        assert a.max() > 5
        np.testing.assert_allclose(a, b, rtol=0.1, atol=0.3)


def test_stepping_under_the_recorded_controls_leads_to_the_same_states(tmp_path):
    text = small_model()
    (tmp_path / "m.xml").write_text(text)
    loaded = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(loaded)
    ctrl, qpos, time = np.linspace(0, 4, 50)[:, None], [], []
    for value in ctrl:
        qpos.append(data.qpos.copy())
        time.append(data.time)
        data.ctrl[:] = value
        mujoco.mj_step(loaded, data)
    whole = {"ctrl": ctrl, "time": np.array(time)}
    for name, states in (("start", {"qpos": qpos[:1]}), ("all", {"qpos": np.array(qpos)})):
        given = saved(tmp_path, **whole, **states)
        import_rollout(tmp_path / "m.xml", given, tmp_path / f"{name}.h5", model_map=SITE, options=OPTIONS)
    with GraspDataset(tmp_path / "start.h5") as start, GraspDataset(tmp_path / "all.h5") as every:
        np.testing.assert_array_equal(start["0001"].contact_force, every["0001"].contact_force)
        assert start["0001"].contact_force.max() > 0.05
        heights = start["0001"].sensor_pose_t[100:, 0, 2, 3]
        np.testing.assert_allclose(heights - heights[0], np.ravel(qpos)[: len(heights)], atol=1e-12)
    drifted = np.array(qpos) + np.linspace(0, 0.01, 50)[:, None]
    with pytest.raises(ImportDataError, match=r"qpos\[\d+, 0\].*--forward"):
        import_rollout(tmp_path / "m.xml", saved(tmp_path, **whole, qpos=drifted), tmp_path / "x.h5", options=OPTIONS)
    import_rollout(
        tmp_path / "m.xml",
        saved(tmp_path, **whole, qpos=drifted),
        tmp_path / "x.h5",
        is_replayed=False,
        options=OPTIONS,
    )


def test_grasps_are_told_apart_by_their_labels(tmp_path):
    (tmp_path / "m.xml").write_text(small_model())
    states = saved(
        tmp_path, qpos=np.zeros((6, 1)), grasp=np.repeat([1, 2], 3), phase=["closing", "hold", "release"] * 2, session=1
    )
    report = import_rollout(tmp_path / "m.xml", states, tmp_path / "sim.h5", options=OPTIONS)
    assert (report.grasps, report.frames, report.added_frames) == (2, 206, 200)
    with GraspDataset(tmp_path / "sim.h5") as data:
        assert list(data.ids) == ["0001", "0002"]
        assert data["0002"].phase[-3:].tolist() == [Phase.CLOSING, Phase.HOLD, Phase.RELEASE]
        assert data["0002"].session == 1


def small_model(prefix="rh_", extra=""):
    """All links as bodies of one plate that a motor pushes against a box; the palm's board is a site that faces it."""
    links = sorted({board.link_name for board in HAND.boards} - {"palm"})
    others = "".join(f'<body name="{prefix}{link}" pos="0 {k + 1} -3"/>' for k, link in enumerate(links))
    return f"""<mujoco><option timestep="0.002" gravity="0 0 0"/><worldbody>{others}
<body name="{prefix}palm" pos="0 0 -0.0012"><joint name="up" type="slide" axis="0 0 1" damping="20"/>
<geom type="box" size="0.06 0.06 0.0005" pos="0 0 0.0005" mass="0.5"/>
<site name="palm_site" pos="0 0 0" quat="1 0 0 0"/></body>
<body name="object"><geom type="box" size="0.015 0.015 0.02" pos="0 0 0.02"/></body>{extra}
</worldbody><actuator><motor joint="up"/></actuator></mujoco>"""


def refused(tmp_path, text=None, parts=None, **states):
    (tmp_path / "m.xml").write_text(small_model() if text is None else text)
    arrays = {"qpos": np.zeros((3, 1))} | states
    path = saved(tmp_path, **{name: value for name, value in arrays.items() if value is not None})
    with pytest.raises(ImportDataError) as caught:
        import_rollout(tmp_path / "m.xml", path, tmp_path / "sim.h5", model_map=parts, options=OPTIONS)
    assert not (tmp_path / "sim.h5").exists()
    message = str(caught.value)
    assert "\n" not in message
    return message


MISTAKES = [
    ("a body", {"text": small_model().replace("rh_th_distal", "rh_th_dista")}, "rh_th_dista"),
    ("no boards", {"text": "<mujoco><worldbody><body name='object'/></worldbody></mujoco>"}, "boards"),
    ("the map", {"parts": {"boards": {"palm": "plam_site"}}}, "did you mean palm_site"),
    ("a kind", {"parts": {"boards": {"palm": {"joint": "up"}}}}, "geom, body or site"),
    ("a board", {"parts": {"boards": {"plam": "palm_site"}}}, "did you mean palm"),
    ("a key", {"parts": {"board": {}}}, "boards"),
    ("a text for a table", {"parts": {"boards": 3}}, "a table"),
    ("the object", {"parts": {"object": {"body": "objet"}}}, "did you mean object"),
    ("the known", {"parts": {"object": {"known": "cylindre"}}}, "did you mean cylinder"),
    (
        "a ball",
        {"text": small_model().replace('type="box" size="0.015 0.015 0.02"', 'type="sphere" size="0.1"')},
        "sphere",
    ),
    ("not MJCF", {"text": "<mujoco><worldbody>"}, "m.xml"),
    ("qpos missing", {"qpos": None}, "qpos: expected an array [T, 1]"),
    ("qpos of another model", {"qpos": np.zeros((3, 7))}, "qpos: expected numbers [T, 1]"),
    ("a NaN", {"qpos": np.array([[0.0], [np.nan], [0.0]])}, "nan at [1, 0]"),
    ("a name", {"qpso": np.zeros(3)}, "did you mean qpos"),
    ("qvel short", {"qvel": np.zeros((2, 1))}, "qvel: expected 3 rows"),
    ("times back", {"time": np.array([0.0, 2.0, 1.0])}, "time[2]"),
    ("a phase", {"phase": ["hold", "hlod", "hold"]}, "phase[1]: expected 0 to 4"),
    ("grasps apart", {"grasp": ["a", "b", "a"]}, "grasp[2]"),
    ("a session", {"session": ["one", "one", "one"]}, "session[0]"),
    ("labels", {"grasp": np.zeros((3, 2))}, "grasp: expected a name"),
    ("an object", {"grasp": np.array([None, 1, 2], dtype=object)}, "plain arrays"),
]


@pytest.mark.parametrize(("what", "wrong", "said"), MISTAKES, ids=[case[0] for case in MISTAKES])
def test_mistakes_are_one_line_that_names_the_place(tmp_path, what, wrong, said):
    assert said in refused(tmp_path, **wrong)


def test_a_site_is_the_brackets_own_frame(tmp_path):
    (tmp_path / "m.xml").write_text(small_model())
    states = saved(tmp_path, qpos=np.array([[0.001], [0.0015]]))
    import_rollout(tmp_path / "m.xml", states, tmp_path / "sim.h5", model_map=SITE, options=OPTIONS)
    with GraspDataset(tmp_path / "sim.h5") as data:
        expected = np.eye(4)
        expected[2, 3] = 0.0015 - 0.0012
        np.testing.assert_allclose(data["0001"].sensor_pose[0], expected, atol=1e-12)


def test_a_missing_baseline_is_refused(tmp_path):
    (tmp_path / "m.xml").write_text(small_model())
    with pytest.raises(ImportDataError, match=r"100 frames of phase 0.*--baseline-frames"):
        import_rollout(tmp_path / "m.xml", saved(tmp_path, qpos=np.zeros((3, 1))), tmp_path / "sim.h5")
