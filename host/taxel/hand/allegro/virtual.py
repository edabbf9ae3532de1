"""Virtual Allegro hand at the other end of a CAN channel."""

import threading
from dataclasses import dataclass, field
from typing import Final

import can
import numpy as np

from taxel.hand.allegro.dynamics import JointDynamics
from taxel.hand.allegro.errors import AllegroFrameError
from taxel.hand.allegro.joints import FINGERS, JOINT_COUNT, JOINTS_PER_FINGER
from taxel.hand.allegro.messages import (
    Config,
    FingerPose,
    HandInfo,
    Imu,
    Message,
    MessageId,
    Request,
    Serial,
    SetPeriod,
    SetPose,
    SetTorque,
    SystemOff,
    SystemOn,
    Temperature,
)
from taxel.hand.allegro.protocol import decode, encode, get_device_id
from taxel.hand.control_loop import ControlLoop
from taxel.types import FloatArray

MAX_TORQUE_NM: Final = 0.7  # of a joint at full PWM; source: manufacturer's data sheet
TEMPERATURE_LIMIT_C: Final = 70  # assumed, since the limit is not public
_HARDWARE_VERSION, _FIRMWARE_VERSION = 0x0400, 0x0400
_NS = 1_000_000_000
_SERVO_PERIOD_NS = 1_000_000  # of the internal position controller
# Gains of the internal position controller, chosen for `FreeJoints`.
_STIFFNESS_NM, _DAMPING_NM_S = 3.0, 0.03
_REPORTS = (MessageId.FINGER_POSE, MessageId.IMU, MessageId.TEMPERATURE)  # in the order of SetPeriod


@dataclass
class VirtualFaults:
    """Faults of the virtual hand, which can be changed at any time.

    temperature_c: above 70 the hand reports a fault and stops its motors. is_servo_off: the motors stay off.
    has_communication_fault: the hand reports an internal fault. is_silent: the hand neither reads nor sends frames.
    dropped_fingers: fingers, 0 to 3, whose pose is not sent.
    """

    temperature_c: int = 35
    is_servo_off: bool = False
    has_communication_fault: bool = False
    is_silent: bool = False
    dropped_fingers: set[int] = field(default_factory=set)


class VirtualAllegro:
    """Model of an Allegro hand V4 on `bus` that drives `dynamics` with the commanded torques.

    bus: the hand's end of the channel; the caller shuts it down. device_id: 0 to 3. hand_type: 0 is right. serial: 1 to
    8 ASCII characters. max_torque_nm: torque of a joint at full PWM. `faults` can be set at any time.

    Use `step` in lock step (virtual time, one thread, no sleeping), `run` in a thread in real time, or `EmulatedBus` in
    real time within the thread of the driver. An internal PD controller executes position commands; a torque command
    holds until the next command. Time is counted in integer nanoseconds, so reports with a period of 3 ms occur at
    exact multiples of 3 ms for any step length.

    .. warning::
        Not modelled: bit timing, arbitration and bus load; lost, late or repeated frames except by `faults`; motor
        current, back EMF, supply voltage and heating; gear backlash and joint elasticity; encoder noise and offset
        (angles are only rounded to counts); the IMU (reports zeros); the start-up time of the motors; the behaviour
        of the physical firmware when commands stop (here the last command holds). The manufacturer's V4 manual lists
        position commands as not implemented; here they work. Config only changes the device id, immediately.
    """

    def __init__(
        self,
        bus: can.BusABC,
        dynamics: JointDynamics,
        device_id: int = 0,
        hand_type: int = 0,
        serial: str = "SAH040VR",
        max_torque_nm: float = MAX_TORQUE_NM,
    ) -> None:
        """Create a model of an Allegro hand on a CAN channel, with the motors off.

        bus: the hand's end of the channel. dynamics: joints that the commanded torques drive. device_id: 0 to 3.
        hand_type: 0 for a right hand. serial: serial number, 1 to 8 ASCII characters. max_torque_nm: torque of a joint
        at full PWM. Raises ValueError for an invalid device id or serial number.
        """
        encode(Serial(serial), device_id)  # raises ValueError for an invalid serial number or device id
        self.dynamics = dynamics
        self.device_id = device_id
        self.hand_type = hand_type
        self.serial = serial
        self.max_torque_nm = max_torque_nm
        self.faults = VirtualFaults()
        self.ignored_frames = 0  # malformed or unexpected frames
        self._bus = bus
        self._time_ns = 0
        self._is_on = False
        self._torque_command: FloatArray = np.zeros(JOINT_COUNT)
        self._target: FloatArray = np.full(JOINT_COUNT, np.nan)  # NaN: torque control
        self._velocities: FloatArray = np.zeros(JOINT_COUNT)
        self._period_ns = dict.fromkeys(_REPORTS, 0)
        self._due_ns = dict.fromkeys(_REPORTS, 0)

    @property
    def time_s(self) -> float:
        """Virtual seconds since the start."""
        return self._time_ns / _NS

    @property
    def next_report_s(self) -> float:
        """Virtual time of the next periodic report, seconds; infinite before the host has set a period."""
        dues = [self._due_ns[report] for report in _REPORTS if self._period_ns[report]]
        return min(dues, default=np.inf) / _NS

    @property
    def servo_on(self) -> bool:
        """Whether the motors of the virtual hand are on: switched on, without a servo fault and not too hot."""
        return self._is_on and not self.faults.is_servo_off and self.faults.temperature_c <= TEMPERATURE_LIMIT_C

    @property
    def torque_command(self) -> FloatArray:
        """Current torque commands, f64[16], fractions of full PWM."""
        return self._torque_command.copy()

    def step(self, dt_s: float) -> None:
        """Process received commands, advance `dt_s` virtual seconds, and send the reports that become due."""
        self._process_frames()
        end_ns = self._time_ns + round(dt_s * _NS)
        while self._time_ns < end_ns:
            dues = [self._due_ns[report] for report in _REPORTS if self._period_ns[report]]
            stop_ns = min([end_ns, *dues])
            if np.isfinite(self._target).any():  # position control computes a new torque in each servo period
                stop_ns = min(stop_ns, self._time_ns + _SERVO_PERIOD_NS)
            self._advance(stop_ns - self._time_ns)
            self._time_ns = stop_ns
            self._send_due_reports()

    def run(self, stop: threading.Event, period_s: float = 0.001) -> None:
        """Advance with real time in steps of about `period_s` until `stop` is set; run it in a separate thread."""
        loop = ControlLoop(period_s, spin_s=0.0)
        offset_s = loop.clock() - self.time_s
        while not stop.is_set():
            loop.wait()
            self.follow(loop.clock() - offset_s)

    def follow(self, time_s: float) -> None:
        """Advance to the virtual time `time_s`, seconds; if that time has passed, only process received commands."""
        self.step(max(0.0, time_s - self.time_s))

    def _process_frames(self) -> None:
        """Execute the commands in all received frames for this device; malformed frames are counted and ignored.

        A silent hand (`faults.is_silent`) discards the frames.
        """
        while (frame := self._bus.recv(0.0)) is not None:
            if self.faults.is_silent or get_device_id(frame) != self.device_id:
                continue
            try:
                message = decode(frame)
            except AllegroFrameError:
                self.ignored_frames += 1
                continue
            if message is not None:
                self._execute(message)

    def _execute(self, message: Message) -> None:
        """Execute a command of the host in the virtual hand: motors, torques, target angles, periods, requests."""
        match message:
            case SetTorque(finger, torque):
                self._torque_command[_get_joint_slice(finger)] = torque
                self._target[_get_joint_slice(finger)] = np.nan
            case SetPose(finger, angles):
                self._target[_get_joint_slice(finger)] = angles
            case Request(kind, index):
                self._send_report(kind, index)
            case SystemOn():
                self._is_on = True
            case SystemOff():
                self._is_on = False
                self._torque_command[:] = 0.0
                self._target[:] = np.nan
            case SetPeriod(position_ms, imu_ms, temperature_ms):
                for report, period_ms in zip(_REPORTS, (position_ms, imu_ms, temperature_ms), strict=True):
                    self._period_ns[report] = period_ms * 1_000_000
                    self._due_ns[report] = self._time_ns + self._period_ns[report]
            case Config(device_id):
                self.device_id = self.device_id if device_id is None else device_id
            case _:
                self.ignored_frames += 1

    def _advance(self, duration_ns: int) -> None:
        """Advance the dynamics of the joints by a duration, nanoseconds."""
        if duration_ns <= 0:
            return
        before = self.dynamics.angles
        after = self.dynamics.step(self._compute_torque(before), duration_ns / _NS)
        self._velocities = (after - before) * (_NS / duration_ns)

    def _compute_torque(self, angles: FloatArray) -> FloatArray:
        """Compute joint torques f64[16], Nm, at angles f64[16]; all 0 while the motors are off.

        A joint with a target is position controlled; any other joint has its commanded torque.
        """
        if not self.servo_on:
            return np.zeros(JOINT_COUNT)
        position_torque = _STIFFNESS_NM * (self._target - angles) - _DAMPING_NM_S * self._velocities
        torque = np.where(np.isnan(self._target), self._torque_command * self.max_torque_nm, position_torque)
        return np.clip(torque, -self.max_torque_nm, self.max_torque_nm)

    def _send_due_reports(self) -> None:
        """Send the periodic reports whose time has come, and schedule the next ones."""
        for report in _REPORTS:
            if self._period_ns[report] and self._time_ns >= self._due_ns[report]:
                self._due_ns[report] += self._period_ns[report]
                for index in range(1 if report is MessageId.IMU else len(FINGERS)):
                    self._send_report(report, index)

    def _send_report(self, kind: MessageId, index: int) -> None:
        """Send report number `index` of this kind on the CAN bus, unless an injected fault suppresses the report."""
        if self.faults.is_silent or (kind is MessageId.FINGER_POSE and index in self.faults.dropped_fingers):
            return
        self._bus.send(encode(self._make_report(kind, index), self.device_id))

    def _make_report(self, kind: MessageId, index: int) -> Message:
        """Make the report of type `kind`; index: finger or temperature sensor, ignored by other reports."""
        match kind:
            case MessageId.FINGER_POSE:
                a, b, c, d = self.dynamics.angles[_get_joint_slice(index)].tolist()
                return FingerPose(index, (a, b, c, d))
            case MessageId.SERIAL:
                return Serial(self.serial)
            case MessageId.IMU:
                return Imu((0, 0, 0))
            case MessageId.TEMPERATURE:
                return Temperature(index, self.faults.temperature_c)
            case _:
                is_hot = self.faults.temperature_c > TEMPERATURE_LIMIT_C
                return HandInfo(
                    _HARDWARE_VERSION,
                    _FIRMWARE_VERSION,
                    self.hand_type,
                    self.faults.temperature_c,
                    self.servo_on,
                    is_hot,
                    self.faults.has_communication_fault,
                )


def _get_joint_slice(finger: int) -> slice:
    """Return the slice of the joints of finger number `finger` in an array of all 16 joints."""
    return slice(JOINTS_PER_FINGER * finger, JOINTS_PER_FINGER * (finger + 1))
