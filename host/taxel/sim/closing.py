"""Simulation of one grasp in a scene: the hand closes, holds and opens, and the wrench on every board is recorded."""

from dataclasses import dataclass, replace
from typing import Final

import mujoco
import numpy as np

from taxel.grasp.controller import GraspController
from taxel.grasp.objects import make_standing_pose
from taxel.grasp.plan import Approach
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.transforms import to_quaternion
from taxel.sim.contact_messages import ContactMessage, MessageRecorder, RecorderSettings
from taxel.sim.contacts import NO_CONTACTS, ContactPoints, StepContacts, compute_board_wrenches, read_contacts
from taxel.sim.native_contact import NativeContact
from taxel.sim.native_push import NativePush
from taxel.sim.scene import STEP_S, Scene
from taxel.sim.soft_contact import LayerLaw
from taxel.sim.soft_push import SOFT_STEP_S, SoftPush
from taxel.types import ByteArray, FloatArray

RATE_HZ: Final = 20.0
"""Samples per second of a grasp dataset."""
SETTLE_S: Final = 0.3
"""Simulated time before closing, seconds: an object that was placed against the open hand comes to rest (chosen)."""
AVERAGED_STEPS: Final = 10
"""Number of steps before a sample over which the wrench of rigid contact is averaged (chosen)."""
START_DEVIATION_RAD: Final = 0.005
"""Standard deviation between grasps of the angle at which a held joint stops, radians (chosen)."""


@dataclass(frozen=True, eq=False)
class GraspMotion:
    """Motion and contact of one simulated grasp: T samples, j joints, L links, s boards; metres, newtons.

    Attributes:
        time_s: f64[T], seconds from the start of the grasp.
        phase: u8[T], see `taxel.grasp.timeline.Phase`.
        joint_angles: f64[T, j], radians, in the order of `scene.joint_names`.
        link_poses: f64[T, L, 4, 4] in the world, in the order of `scene.links`.
        sensor_poses: f64[T, s, 4, 4], poses of the brackets in the world, in the order of `hand.boards`.
        object_pose: f64[T, 4, 4] in the world.
        wrench: f64[T, s, 6], force and moment that the object applies to each board, about the bracket's origin and in
            the bracket's frame. Rigid contact: mean of the last steps before the sample. Contact between fingers is
            not included.
        contacts: MuJoCo's contact points between hand and object at the samples; empty with a soft layer.
        taxel_force: f64[T, n], newtons along each taxel's normal, with a soft layer; None with rigid contact.
        messages: messages of the boards' contact sensors in ascending order of time; None if they are not recorded.
    """

    time_s: FloatArray
    phase: ByteArray
    joint_angles: FloatArray
    link_poses: FloatArray
    sensor_poses: FloatArray
    object_pose: FloatArray
    wrench: FloatArray
    contacts: ContactPoints
    taxel_force: FloatArray | None = None
    messages: tuple[ContactMessage, ...] | None = None


@dataclass(frozen=True, eq=False)
class SimulationSettings:
    """Settings of one simulated grasp that are independent of its scene, approach and timeline.

    Attributes:
        rate_hz: samples per second; at most one sample per step of `STEP_S`.
        object_offset: f64[4, 4], true pose of the object in its nominal frame; None: the nominal pose.
        torque_scale: factor on the planned torques.
        seed: seed of the deviations of the held joints (`START_DEVIATION_RAD`); None: no deviations.
        object_pose: f64[4, 4], nominal pose of the object in the world; None: `make_standing_pose()`.
        law: force law of a soft layer between hand and object; None: rigid boards touch the object.
        soft_step_s: time step with a soft layer, seconds. Doubling the default changes the result by less than the
            uncertainty of the layer's parameters.
        settle_s: simulated time before closing, seconds.
        recorder: records messages of contact sensors, which needs rigid contact; None: no messages.
        holds_object: whether the object is held at its pose during the whole grasp, as by a stiff clamp.
    """

    rate_hz: float = RATE_HZ
    object_offset: FloatArray | None = None
    torque_scale: float = 1.0
    seed: int | None = None
    object_pose: FloatArray | None = None
    law: LayerLaw | None = None
    soft_step_s: float = SOFT_STEP_S
    settle_s: float = SETTLE_S
    recorder: RecorderSettings | None = None
    holds_object: bool = False


DEFAULT_SETTINGS: Final = SimulationSettings()


@dataclass(frozen=True, eq=False)
class _Sample:
    """State of the scene at one time; fields as in `GraspMotion`, without the axis T."""

    joint_angles: FloatArray
    link_poses: FloatArray
    sensor_poses: FloatArray
    object_pose: FloatArray
    wrench: FloatArray
    contacts: StepContacts
    taxel_force: FloatArray | None


def simulate_grasp(
    scene: Scene, approach: Approach, timeline: Timeline, settings: SimulationSettings = DEFAULT_SETTINGS
) -> GraspMotion:
    """Simulate one grasp. Equal arguments give bit-identical results.

    The palm moves to the object when closing begins and withdraws at the end of release (`Timeline.get_withdrawal`).
    The baseline and recovery phases are static copies of the state before closing and after release.

    Args:
        scene: scene with the object of the approach.
        approach: approach with its joints in the order of `scene.joint_names`.
        timeline: durations of the phases.
        settings: sampling rate, displacement of the object, contact model and time steps.

    Raises:
        ValueError: the approach has another number of joints or another object than the scene, the rate is above one
            sample per step, or messages are to be recorded with a soft layer.
    """
    _check_arguments(scene, approach, settings.rate_hz)
    if settings.recorder is not None and settings.law is not None:
        raise ValueError("recorder: expected rigid contact, found a soft layer, which has no contact points")
    nominal_pose = make_standing_pose() if settings.object_pose is None else settings.object_pose
    true_pose = nominal_pose if settings.object_offset is None else nominal_pose @ settings.object_offset
    push = None
    if settings.law is not None:
        contact = NativeContact(scene.hand, scene.grasp_object.shape, settings.law)
        push = NativePush(scene, contact, settings.soft_step_s)
    controller = GraspController(_deviate_targets(approach, settings.seed), timeline, settings.torque_scale)
    recorder = MessageRecorder(scene, settings.recorder) if settings.recorder is not None else None
    run = _Run(scene, controller, nominal_pose, push, recorder, settings.holds_object)
    run.place_bodies(true_pose)
    return run.record(timeline, settings.rate_hz, settings.settle_s)


def _check_arguments(scene: Scene, approach: Approach, rate_hz: float) -> None:
    """Raise ValueError unless approach, scene and sampling rate fit together; see `simulate_grasp`."""
    joints = len(scene.joint_names)
    if approach.torque.shape != (joints,):
        raise ValueError(f"approach {approach.name!r}: expected {joints} joints, found {approach.torque.shape}")
    if approach.object != scene.grasp_object.name:
        raise ValueError(
            f"approach {approach.name!r} is for {approach.object!r}, the scene holds {scene.grasp_object.name!r}"
        )
    if not 0 < rate_hz <= 1 / STEP_S:
        raise ValueError(f"rate_hz: expected above 0 and at most {1 / STEP_S:g}, found {rate_hz}")


def _deviate_targets(approach: Approach, seed: int | None) -> Approach:
    """Add a random deviation to the target angles of the joints that the approach holds in place.

    seed: seed of the random numbers; None: the approach is returned unchanged.
    """
    if seed is None:
        return approach
    deviation = np.random.default_rng(seed).normal(0.0, START_DEVIATION_RAD, approach.base_targets.shape)
    return replace(approach, base_targets=approach.base_targets + deviation)


class _Run:
    """One grasp while it is simulated: MuJoCo's data, the controller, and the wrenches of the last steps."""

    def __init__(
        self,
        scene: Scene,
        controller: GraspController,
        nominal_pose: FloatArray,
        push: SoftPush | None,
        recorder: MessageRecorder | None = None,
        holds_object: bool = False,
    ) -> None:
        """Prepare the simulation of one grasp in a MuJoCo scene.

        controller: computes the joint targets and torques of the fingers. nominal_pose: f64[4, 4], pose of the object
        that the grasp plan assumes. push: time integration with the soft layer's contact; None: MuJoCo's own contact.
        recorder: records messages of contact sensors; None: no messages. holds_object: hold the object all the time.
        """
        self.scene = scene
        self.controller = controller
        self.nominal_pose = nominal_pose
        self.data = mujoco.MjData(scene.model)
        self._push = push
        self._recorder = recorder
        self._holds_object = holds_object
        self._step_s = STEP_S if push is None else push.step_s
        self._recent_wrenches: list[FloatArray] = []
        self._withdrawal = -1.0  # outside 0..1: the palm has no pose yet

    def place_bodies(self, object_pose: FloatArray) -> None:
        """Set stand, object, palm and joints to their state before the grasp; object_pose: f64[4, 4] in the world."""
        self.scene.place_object(self.data, object_pose)
        if self._push is not None:
            self._push.place_stand(object_pose)
        palm_pose = self.nominal_pose @ self.controller.approach.compute_palm_pose_at(1.0)  # 1: fully withdrawn
        self._set_body_pose(self.scene.link_bodies[0], palm_pose)
        self.data.qpos[self.scene.joint_addresses] = self.controller.approach.open_angles

    def _set_body_pose(self, body: int, pose: FloatArray) -> None:
        """Prescribe the pose f64[4, 4] of a body of the MuJoCo scene in the world frame."""
        index = self.scene.model.body_mocapid[body]
        self.data.mocap_pos[index] = pose[:3, 3]
        self.data.mocap_quat[index] = to_quaternion(pose)

    def _move_palm(self, time_s: float) -> None:
        """Set the palm to its pose at `time_s` seconds of the grasp; called before each time step."""
        withdrawal = self.controller.timeline.get_withdrawal(time_s)
        if withdrawal != self._withdrawal:
            index = self.scene.model.body_mocapid[self.scene.link_bodies[0]]
            pose = self.nominal_pose @ self.controller.approach.compute_palm_pose_at(withdrawal)
            self.data.mocap_pos[index] = pose[:3, 3]  # the palm withdraws without rotation
            self._withdrawal = withdrawal

    def record(self, timeline: Timeline, rate_hz: float, settle_s: float) -> GraspMotion:
        """Simulate from rest to the end of the release phase, and return the samples at `rate_hz` as a motion.

        settle_s: simulated time before the first sample, in which the fingers come to rest.
        """
        times = timeline.make_sample_times(rate_hz)
        begin_s, end_s = timeline.get_start_s(Phase.CLOSING), timeline.get_start_s(Phase.RECOVERY)
        for _ in range(round(settle_s / self._step_s)):
            self._step(0.0)
        samples: list[_Sample] = []
        step_count, sample = 0, self._take_sample()
        for time_s in times:
            last_step = round((min(max(time_s, begin_s), end_s) - begin_s) / self._step_s)
            if last_step > step_count:
                for step in range(step_count, last_step):
                    self._step(begin_s + step * self._step_s, record_wrench=step >= last_step - AVERAGED_STEPS)
                step_count, sample = last_step, self._take_sample()
            samples.append(sample)
        if self._recorder is not None:
            self._recorder.send()
        return self._join_samples(times, timeline.find_phases(times), samples)

    def _step(self, time_s: float, record_wrench: bool = False) -> None:
        """Advance the scene by one time step with the joint torques for `time_s` seconds of the grasp.

        record_wrench: with rigid contact, store the wrenches on the boards, whose mean is part of the next sample.
        """
        scene, data = self.scene, self.data
        self._move_palm(time_s)
        angles, velocities = data.qpos[scene.joint_addresses], data.qvel[scene.joint_dofs]
        data.qfrc_applied[scene.joint_dofs] = self.controller.compute_torque(time_s, angles, velocities)
        steadying = 1.0 if self._holds_object else self.controller.timeline.get_steadying(time_s)
        if self._push is not None:
            self._push.set_firmness(steadying)
            self._push.step(data)
            return
        self._set_hold(is_held=steadying > 0.5)
        mujoco.mj_step(scene.model, data)
        if self._recorder is not None:
            self._recorder.observe(data, time_s + self._step_s)
        if record_wrench:
            self._recent_wrenches.append(self._compute_wrenches(read_contacts(scene, data)))

    def _set_hold(self, is_held: bool) -> None:
        """Activate or release the constraint that models the experimenter's hold on the object, with rigid contact.

        A hold that begins fixes the object at its present pose.
        """
        data, constraint = self.data, self.scene.model.equality("steadying").id
        if is_held and not data.eq_active[constraint]:
            body = self.scene.model.body("object").id
            index = self.scene.model.body_mocapid[self.scene.model.body("experimenter").id]
            data.mocap_pos[index], data.mocap_quat[index] = data.xpos[body], data.xquat[body]
        data.eq_active[constraint] = is_held

    def _compute_sensor_poses(self) -> FloatArray:
        """Return the present poses of the brackets in the world, f64[s, 4, 4]."""
        bodies = self.scene.board_bodies
        return _compose_poses(self.data.xmat[bodies], self.data.xpos[bodies]) @ self.scene.board_poses

    def _compute_wrenches(self, contacts: StepContacts) -> FloatArray:
        """Compute the wrenches of contact points on the boards, f64[s, 6] (N, Nm), bracket frames."""
        return compute_board_wrenches(contacts, self._compute_sensor_poses())

    def _take_sample(self) -> _Sample:
        """Return the present state of the scene; poses and forces belong to the same time as the joint angles.

        With rigid contact, the wrenches are the mean of those stored since the last sample, which are then discarded.
        """
        scene, data = self.scene, self.data
        taxel_force = None
        if self._push is not None:
            mujoco.mj_kinematics(scene.model, data)
            contacts = NO_CONTACTS
            wrench, taxel_force = self._push.compute_loads(data)
        else:
            mujoco.mj_forward(scene.model, data)
            contacts = read_contacts(scene, data)
            wrench = np.mean(self._recent_wrenches or [self._compute_wrenches(contacts)], axis=0)
            self._recent_wrenches = []
        object_body = scene.model.body("object").id
        return _Sample(
            data.qpos[scene.joint_addresses],
            _compose_poses(data.xmat[scene.link_bodies], data.xpos[scene.link_bodies]),
            self._compute_sensor_poses(),
            _compose_poses(data.xmat[object_body], data.xpos[object_body]),
            wrench,
            contacts,
            taxel_force,
        )

    def _join_samples(self, times: FloatArray, phase: ByteArray, samples: list[_Sample]) -> GraspMotion:
        """Join samples into the motion of the grasp; times: f64[T], seconds, and phase: u8[T], one for each sample."""
        return GraspMotion(
            times,
            phase,
            np.stack([sample.joint_angles for sample in samples]),
            np.stack([sample.link_poses for sample in samples]),
            np.stack([sample.sensor_poses for sample in samples]),
            np.stack([sample.object_pose for sample in samples]),
            np.stack([sample.wrench for sample in samples]),
            ContactPoints.concatenate([sample.contacts for sample in samples]),
            None
            if self._push is None
            else np.stack([sample.taxel_force for sample in samples if sample.taxel_force is not None]),
            None if self._recorder is None else tuple(self._recorder.messages),
        )


def _compose_poses(rotations: FloatArray, origins: FloatArray) -> FloatArray:
    """Build poses f64[..., 4, 4] from MuJoCo's row-major rotation matrices f64[..., 9] and origins f64[..., 3]."""
    poses = np.zeros((*origins.shape[:-1], 4, 4))
    poses[..., :3, :3] = rotations.reshape(*origins.shape[:-1], 3, 3)
    poses[..., :3, 3] = origins
    poses[..., 3, 3] = 1.0
    return poses
