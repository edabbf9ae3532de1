"""Time steps in C agree with the Python implementation, for all parts of the equations of motion."""

import ctypes

import mujoco
import numpy as np
import pytest

from taxel.grasp.objects import ASSUMED_SIZES, make_standing_pose, make_thesis_objects
from taxel.grasp.plan import make_thesis_approaches
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.sim import closing, native_push
from taxel.sim.closing import SimulationSettings, simulate_grasp
from taxel.sim.native_contact import NativeContact
from taxel.sim.native_push import NativePush
from taxel.sim.scene import build_scene
from taxel.sim.sim_library import SimLibraryError
from taxel.sim.soft_contact import LayerLaw
from taxel.sim.soft_push import SoftPush

LAW = LayerLaw()
SHORT = Timeline(baseline_s=0.05, closing_s=0.5, hold_s=0.1, release_s=0.2, recovery_s=0.0)


@pytest.fixture(scope="module", params=["rectangular_prism", "cylinder"])
def scene(request):
    return build_scene(load_hand("allegro"), make_thesis_objects(ASSUMED_SIZES)[request.param], "palm")


def test_a_simulated_grasp_agrees_with_the_python_steps(scene, monkeypatch):
    approach = next(one for one in make_thesis_approaches(withdraw_m=0.02) if one.object == scene.grasp_object.name)
    settings = SimulationSettings(law=LAW, seed=5)
    native = simulate_grasp(scene, approach, SHORT, settings)
    monkeypatch.setattr(closing, "NativePush", SoftPush)
    reference = simulate_grasp(scene, approach, SHORT, settings)
    until_hold = native.phase <= Phase.HOLD  # fingers bounce at release, which amplifies rounding errors
    assert native.taxel_force[until_hold].max() > 1.0
    np.testing.assert_allclose(native.taxel_force[until_hold], reference.taxel_force[until_hold], atol=1e-5)
    np.testing.assert_allclose(native.object_pose[until_hold], reference.object_pose[until_hold], atol=1e-7)
    np.testing.assert_allclose(native.joint_angles[until_hold], reference.joint_angles[until_hold], atol=1e-6)
    np.testing.assert_allclose(native.joint_angles, reference.joint_angles, atol=1e-3)


def prepare(scene, push_class, seed):
    """Prepare a time integration (of `push_class`) and MuJoCo's data; return both and the random generator.

    The object moves at a random velocity, and some joints are beyond their ranges; all random numbers follow from seed.
    """
    push = push_class(scene, NativeContact(scene.hand, scene.grasp_object.shape, LAW))
    data, random = mujoco.MjData(scene.model), np.random.default_rng(seed)
    pose = make_standing_pose()
    push.place_stand(pose)
    pose[2, 3] -= 0.0002  # pressed into the stand
    scene.place_object(data, pose)
    low, high = scene.model.jnt_range[scene.model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE].T
    data.qpos[scene.joint_addresses] = low + (high - low) * random.uniform(-0.05, 1.05, len(low))
    data.qvel[:] = random.normal(0.0, 0.3, scene.model.nv)
    return push, data, random


@pytest.mark.parametrize("seed", range(3))
def test_a_moving_and_steadied_object_follows_the_path_of_the_python_steps(scene, seed):
    """The firmness, 0 to 1, is a factor on the springs and dampers by which an experimenter steadies the object."""
    results = []
    for push_class in (NativePush, SoftPush):
        push, data, random = prepare(scene, push_class, seed)
        states = []
        for step in range(40):
            push.set_firmness(float(random.choice([0.0, 0.5, 1.0])) if step % 10 == 0 else push.steadying.firmness)
            data.qfrc_applied[scene.joint_dofs] = random.normal(0.0, 0.3, len(scene.joint_dofs))
            push.step(data)
            states.append(np.concatenate([data.qpos, data.qvel, [data.time]]))
        results.append(np.array(states))
    native, reference = results
    assert np.abs(reference[-1] - reference[0]).max() > 0.05
    np.testing.assert_allclose(native, reference, atol=1e-6)


def test_equal_arguments_give_bit_identical_results(scene):
    states = []
    for _ in range(2):
        push, data, _ = prepare(scene, NativePush, 9)
        for _ in range(20):
            push.step(data)
        states.append(data.qpos.copy())
    np.testing.assert_array_equal(*states)


def test_a_library_of_another_version_is_refused(scene, monkeypatch):
    class Longer(ctypes.Structure):
        _fields_ = [*native_push._Push._fields_, ("further", ctypes.c_double)]

    monkeypatch.setattr(native_push, "_Push", Longer)
    with pytest.raises(SimLibraryError, match="belongs to another version"):
        NativePush(scene, NativeContact(scene.hand, scene.grasp_object.shape, LAW))
