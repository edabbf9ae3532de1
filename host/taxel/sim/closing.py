"""One grasp in a scene: the hand closes, holds and opens, and every board's contact wrench is recorded."""

from dataclasses import dataclass, replace
from typing import Final

import mujoco
import numpy as np
import numpy.typing as npt

from taxel.grasp.controller import GraspController
from taxel.grasp.objects import make_standing_pose
from taxel.grasp.plan import Approach
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.transforms import to_quaternion
from taxel.sim.contacts import NO_CONTACTS, ContactPoints, StepContacts, board_wrenches, read_contacts
from taxel.sim.native_contact import NativeContact
from taxel.sim.scene import STEP_S, Scene
from taxel.sim.soft_contact import LayerLaw
from taxel.sim.soft_push import SOFT_STEP_S, SoftPush
from taxel.types import FloatArray

RATE_HZ: Final = 20.0
SETTLE_S: Final = 0.3  # before closing: an object that was placed against the open hand comes to rest
AVERAGED_STEPS: Final = 10  # steps before a sample over which its wrench is the mean
START_SPREAD_RAD: Final = 0.005  # standard deviation of where a held joint stops from one grasp to the next (chosen)


@dataclass(frozen=True, eq=False)
class GraspMotion:
    """What moved and what pressed during one grasp: T samples, j joints, L links, s boards; metres, newtons.

    Attributes:
        time_s: f64[T], from the start of the grasp.
        phase: u8[T], see `taxel.grasp.timeline.Phase`.
        joint_angles: f64[T, j], radians, in the order of `scene.joint_names`.
        link_poses: f64[T, L, 4, 4] in the world, in the order of `scene.links`.
        sensor_poses: f64[T, s, 4, 4], the brackets in the world, in the order of `hand.boards`.
        object_pose: f64[T, 4, 4] in the world.
        wrench: f64[T, s, 6], what the object does to each board: force and moment about the bracket's origin, in the
            bracket's frame, mean of the last steps before the sample. Contact of one finger with another is not in it.
        contacts: MuJoCo's contact points of the hand with the object at the samples; none with a soft layer.
        taxel_force: f64[T, n], newtons along each taxel's normal, of a soft layer; None without one.
    """

    time_s: FloatArray
    phase: npt.NDArray[np.uint8]
    joint_angles: FloatArray
    link_poses: FloatArray
    sensor_poses: FloatArray
    object_pose: FloatArray
    wrench: FloatArray
    contacts: ContactPoints
    taxel_force: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class _State:
    """The scene at one moment."""

    angles: FloatArray
    links: FloatArray
    sensors: FloatArray
    object: FloatArray
    wrench: FloatArray
    contacts: StepContacts
    taxel_force: FloatArray | None


def simulate_grasp(
    scene: Scene,
    approach: Approach,
    timeline: Timeline,
    rate_hz: float = RATE_HZ,
    object_offset: FloatArray | None = None,
    torque_scale: float = 1.0,
    seed: int | None = None,
    object_pose: FloatArray | None = None,
    law: LayerLaw | None = None,
    soft_step_s: float = SOFT_STEP_S,
    settle_s: float = SETTLE_S,
) -> GraspMotion:
    """Run one grasp. The same arguments give the same bytes.

    The palm comes to the object when closing begins and withdraws at the end of release (`Timeline.get_withdrawal`).
    Baseline and recovery are static: the states before and after.

    Args:
        scene: of the object that the approach is for.
        approach: joints in the order of `scene.joint_names`.
        timeline: the phases.
        rate_hz: samples a second; at most one a step of `STEP_S`.
        object_offset: f64[4, 4], where the object truly is in its nominal frame; None: there.
        torque_scale: factor on the planned torques.
        seed: draws where the held joints truly stop (`START_SPREAD_RAD`); None: exactly where planned.
        object_pose: nominal pose in the world, f64[4, 4]; None: `make_standing_pose()`.
        law: of a soft layer that bears between hand and object; None: rigid boards meet it.
        soft_step_s: seconds of a step with a soft layer; twice the usual one is as good as the layer's own figures.
        settle_s: seconds before closing.

    Raises:
        ValueError: another number of joints, another object, or a rate above one sample a step.
    """
    _check(scene, approach, rate_hz)
    nominal = make_standing_pose() if object_pose is None else object_pose
    true = nominal if object_offset is None else nominal @ object_offset
    soft = None if law is None else NativeContact(scene.hand, scene.item.shape, law)
    push = None if soft is None else SoftPush(scene, soft, soft_step_s)
    run = _Run(scene, GraspController(_spread(approach, seed), timeline, torque_scale), nominal, push)
    run.place(true)
    return run.record(timeline, rate_hz, settle_s)


def _check(scene: Scene, approach: Approach, rate_hz: float) -> None:
    joints = len(scene.joint_names)
    if approach.torque.shape != (joints,):
        raise ValueError(f"approach {approach.name!r}: expected {joints} joints, found {approach.torque.shape}")
    if approach.object != scene.item.name:
        raise ValueError(f"approach {approach.name!r} is for {approach.object!r}, the scene holds {scene.item.name!r}")
    if not 0 < rate_hz <= 1 / STEP_S:
        raise ValueError(f"rate_hz: expected above 0 and at most {1 / STEP_S:g}, found {rate_hz}")


def _spread(approach: Approach, seed: int | None) -> Approach:
    if seed is None:
        return approach
    drawn = np.random.default_rng(seed).normal(0.0, START_SPREAD_RAD, approach.base_targets.shape)
    return replace(approach, base_targets=approach.base_targets + drawn)


class _Run:
    """The state of one grasp."""

    def __init__(self, scene: Scene, controller: GraspController, nominal: FloatArray, soft: SoftPush | None) -> None:
        self.scene = scene
        self.controller = controller
        self.nominal = nominal
        self.data = mujoco.MjData(scene.model)
        self._soft = soft
        self._step_s = STEP_S if soft is None else soft.step_s
        self._recent: list[FloatArray] = []
        self._withdrawn = -1.0  # no place yet

    def place(self, item: FloatArray) -> None:
        """Put the mount, the palm and the joints where the grasp begins."""
        self._put(self.scene.model.body("mount").id, item)
        self._put(self.scene.link_bodies[0], self.nominal @ self.controller.approach.compute_palm_pose_at(1.0))
        self.data.qpos[self.scene.joint_addresses] = self.controller.approach.open_angles

    def _put(self, body: int, transform: FloatArray) -> None:
        index = self.scene.model.body_mocapid[body]
        self.data.mocap_pos[index] = transform[:3, 3]
        self.data.mocap_quat[index] = to_quaternion(transform)

    def _put_palm(self, time: float) -> None:
        withdrawn = self.controller.timeline.get_withdrawal(time)
        if withdrawn != self._withdrawn:
            index = self.scene.model.body_mocapid[self.scene.link_bodies[0]]
            pose = self.nominal @ self.controller.approach.compute_palm_pose_at(withdrawn)
            self.data.mocap_pos[index] = pose[:3, 3]  # it withdraws without turning
            self._withdrawn = withdrawn

    def record(self, timeline: Timeline, rate_hz: float, settle_s: float) -> GraspMotion:
        """Step from rest to the end of release, and take the samples."""
        times = timeline.make_sample_times(rate_hz)
        begin, end = timeline.get_start_s(Phase.CLOSING), timeline.get_start_s(Phase.RECOVERY)
        for _ in range(round(settle_s / self._step_s)):
            self._step(0.0)
        states: list[_State] = []
        done, now = 0, self._state()
        for time in times:
            wanted = round((min(max(time, begin), end) - begin) / self._step_s)
            if wanted > done:
                for step in range(done, wanted):
                    self._step(begin + step * self._step_s, watched=step >= wanted - AVERAGED_STEPS)
                done, now = wanted, self._state()
            states.append(now)
        return self._motion(times, timeline.find_phases(times), states)

    def _step(self, time: float, watched: bool = False) -> None:
        scene, data = self.scene, self.data
        self._put_palm(time)
        angles, velocities = data.qpos[scene.joint_addresses], data.qvel[scene.joint_dofs]
        data.qfrc_applied[scene.joint_dofs] = self.controller.compute_torque(time, angles, velocities)
        if self._soft is not None:
            self._soft.step(data)
            return
        mujoco.mj_step(scene.model, data)
        if watched:
            self._recent.append(self._wrenches(read_contacts(scene, data)))

    def _sensors(self) -> FloatArray:
        bodies = self.scene.board_bodies
        return _poses(self.data.xmat[bodies], self.data.xpos[bodies]) @ self.scene.board_poses

    def _wrenches(self, contacts: StepContacts) -> FloatArray:
        return board_wrenches(contacts, self._sensors())

    def _state(self) -> _State:
        """The present state; poses and forces of the same moment, which is the angles' too."""
        scene, data = self.scene, self.data
        felt = None
        if self._soft is not None:
            mujoco.mj_kinematics(scene.model, data)
            contacts = NO_CONTACTS
            wrench, felt = self._soft.feel(data)
        else:
            mujoco.mj_forward(scene.model, data)
            contacts = read_contacts(scene, data)
            wrench = np.mean(self._recent or [self._wrenches(contacts)], axis=0)
            self._recent = []
        item = scene.model.body("object").id
        return _State(
            data.qpos[scene.joint_addresses],
            _poses(data.xmat[scene.link_bodies], data.xpos[scene.link_bodies]),
            self._sensors(),
            _poses(data.xmat[item], data.xpos[item]),
            wrench,
            contacts,
            felt,
        )

    def _motion(self, times: FloatArray, phase: npt.NDArray[np.uint8], states: list[_State]) -> GraspMotion:
        return GraspMotion(
            times,
            phase,
            np.stack([state.angles for state in states]),
            np.stack([state.links for state in states]),
            np.stack([state.sensors for state in states]),
            np.stack([state.object for state in states]),
            np.stack([state.wrench for state in states]),
            ContactPoints.of([state.contacts for state in states]),
            None
            if self._soft is None
            else np.stack([state.taxel_force for state in states if state.taxel_force is not None]),
        )


def _poses(rotations: FloatArray, origins: FloatArray) -> FloatArray:
    result = np.zeros((*origins.shape[:-1], 4, 4))
    result[..., :3, :3] = rotations.reshape(*origins.shape[:-1], 3, 3)
    result[..., :3, 3] = origins
    result[..., 3, 3] = 1.0
    return result
