"""A virtual Allegro hand at the other end of a CAN channel."""

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
from taxel.hand.allegro.protocol import decode, device_of, encode
from taxel.hand.control_loop import ControlLoop
from taxel.types import FloatArray

MAX_TORQUE_NM: Final = 0.7  # of a joint at full PWM; source: the maker's data sheet
TEMPERATURE_LIMIT_C: Final = 70  # chosen: the real limit is not public
_HARDWARE_VERSION, _FIRMWARE_VERSION = 0x0400, 0x0400
_NS = 1_000_000_000
_SERVO_PERIOD_NS = 1_000_000  # of the inner position law
# The inner position law, chosen for `FreeJoints`.
_STIFFNESS_NM, _DAMPING_NM_S = 3.0, 0.03
_REPORTS = (MessageId.FINGER_POSE, MessageId.IMU, MessageId.TEMPERATURE)  # in the order of SetPeriod


@dataclass
class VirtualFaults:
    """What is wrong with the virtual hand; may be changed at any time.

    temperature_c: above 70 the hand reports its fault and stops its motors. servo_off: the motors stay off whatever is
    commanded. communication: the hand reports its internal fault. silent: it neither reads nor sends.
    dropped_fingers: fingers, 0 to 3, whose pose is not sent.
    """

    temperature_c: int = 35
    servo_off: bool = False
    communication: bool = False
    silent: bool = False
    dropped_fingers: set[int] = field(default_factory=set)


class VirtualAllegro:
    """Answers like an Allegro hand V4 on `bus` and moves `dynamics` with the torques it is sent.

    bus: its own end of the channel; stays the caller's. device_id: 0 to 3. hand_type: 0 is right. serial: 1 to 8 ASCII
    characters. max_torque_nm: torque of a joint at full PWM. `faults` may be set at any time.

    Run it with `step` in lock step (virtual time, one thread, nothing sleeps) or with `run` in a thread in real time.
    Position commands are held by an inner PD law, torque commands until the next one. Time is kept in whole
    nanoseconds, so a report that is due each 3 ms comes at exact multiples of 3 ms, at whatever steps.

    .. warning::
        Not modelled: bit timing, arbitration and bus load; lost, late or repeated frames other than by `faults`;
        motor current, back EMF, supply voltage and heating; gear backlash and joint elasticity; encoder noise and
        offset (angles are only rounded to counts); the IMU (reports zeros); the time that the motors need to come on;
        what the real firmware does when commands stop coming (here the last one holds). The maker's V4 manual calls
        position commands not implemented; here they work. Config changes the device id at once and nothing else.
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
        encode(Serial(serial), device_id)  # refuses what the wire cannot hold
        self.dynamics = dynamics
        self.device_id = device_id
        self.hand_type = hand_type
        self.serial = serial
        self.max_torque_nm = max_torque_nm
        self.faults = VirtualFaults()
        self.ignored = 0  # frames that were not understood
        self._bus = bus
        self._time_ns = 0
        self._is_on = False
        self._demand: FloatArray = np.zeros(JOINT_COUNT)
        self._target: FloatArray = np.full(JOINT_COUNT, np.nan)  # NaN: the joint is under torque control
        self._velocities: FloatArray = np.zeros(JOINT_COUNT)
        self._period_ns = dict.fromkeys(_REPORTS, 0)
        self._due_ns = dict.fromkeys(_REPORTS, 0)

    @property
    def time_s(self) -> float:
        """Virtual seconds since the start."""
        return self._time_ns / _NS

    @property
    def servo_on(self) -> bool:
        """Whether the motors are on."""
        return self._is_on and not self.faults.servo_off and self.faults.temperature_c <= TEMPERATURE_LIMIT_C

    @property
    def demand(self) -> FloatArray:
        """f64[16], the torque demands held, shares of full PWM."""
        return self._demand.copy()

    def step(self, dt_s: float) -> None:
        """Read the commands that are there, move for `dt_s` virtual seconds, send what falls due on the way."""
        self._read()
        end_ns = self._time_ns + round(dt_s * _NS)
        while self._time_ns < end_ns:
            dues = [self._due_ns[report] for report in _REPORTS if self._period_ns[report]]
            stop_ns = min([end_ns, *dues])
            if np.isfinite(self._target).any():
                stop_ns = min(stop_ns, self._time_ns + _SERVO_PERIOD_NS)
            self._move(stop_ns - self._time_ns)
            self._time_ns = stop_ns
            self._send_due()

    def run(self, stop: threading.Event, period_s: float = 0.001) -> None:
        """Keep up with real time in steps of about `period_s` until `stop` is set. Runs in a thread of its own."""
        loop = ControlLoop(period_s, spin_s=0.0)
        begun_s = loop.clock()
        begun_ns = self._time_ns
        while not stop.is_set():
            loop.wait()
            self.step(max(0.0, loop.clock() - begun_s - (self._time_ns - begun_ns) / _NS))

    def _read(self) -> None:
        while (frame := self._bus.recv(0.0)) is not None:
            if self.faults.silent or device_of(frame) != self.device_id:
                continue
            try:
                message = decode(frame)
            except AllegroFrameError:
                self.ignored += 1
                continue
            if message is not None:
                self._obey(message)

    def _obey(self, message: Message) -> None:
        match message:
            case SetTorque(finger, demand):
                self._demand[_joints_of(finger)] = demand
                self._target[_joints_of(finger)] = np.nan
            case SetPose(finger, angles):
                self._target[_joints_of(finger)] = angles
            case Request(kind, index):
                self._report(kind, index)
            case SystemOn():
                self._is_on = True
            case SystemOff():
                self._is_on = False
                self._demand[:] = 0.0
                self._target[:] = np.nan
            case SetPeriod(position_ms, imu_ms, temperature_ms):
                for report, period_ms in zip(_REPORTS, (position_ms, imu_ms, temperature_ms), strict=True):
                    self._period_ns[report] = period_ms * 1_000_000
                    self._due_ns[report] = self._time_ns + self._period_ns[report]
            case Config(device_id):
                self.device_id = self.device_id if device_id is None else device_id
            case _:
                self.ignored += 1

    def _move(self, duration_ns: int) -> None:
        if duration_ns <= 0:
            return
        before = self.dynamics.angles
        after = self.dynamics.step(self._torque(before), duration_ns / _NS)
        self._velocities = (after - before) * (_NS / duration_ns)

    def _torque(self, angles: FloatArray) -> FloatArray:
        if not self.servo_on:
            return np.zeros(JOINT_COUNT)
        inner = _STIFFNESS_NM * (self._target - angles) - _DAMPING_NM_S * self._velocities
        torque = np.where(np.isnan(self._target), self._demand * self.max_torque_nm, inner)
        return np.clip(torque, -self.max_torque_nm, self.max_torque_nm)

    def _send_due(self) -> None:
        for report in _REPORTS:
            if self._period_ns[report] and self._time_ns >= self._due_ns[report]:
                self._due_ns[report] += self._period_ns[report]
                for index in range(1 if report is MessageId.IMU else len(FINGERS)):
                    self._report(report, index)

    def _report(self, kind: MessageId, index: int) -> None:
        if self.faults.silent or (kind is MessageId.FINGER_POSE and index in self.faults.dropped_fingers):
            return
        self._bus.send(encode(self._reply(kind, index), self.device_id))

    def _reply(self, kind: MessageId, index: int) -> Message:
        match kind:
            case MessageId.FINGER_POSE:
                a, b, c, d = self.dynamics.angles[_joints_of(index)].tolist()
                return FingerPose(index, (a, b, c, d))
            case MessageId.SERIAL:
                return Serial(self.serial)
            case MessageId.IMU:
                return Imu((0, 0, 0))
            case MessageId.TEMPERATURE:
                return Temperature(index, self.faults.temperature_c)
            case _:
                hot = self.faults.temperature_c > TEMPERATURE_LIMIT_C
                return HandInfo(
                    _HARDWARE_VERSION,
                    _FIRMWARE_VERSION,
                    self.hand_type,
                    self.faults.temperature_c,
                    self.servo_on,
                    hot,
                    self.faults.communication,
                )


def _joints_of(finger: int) -> slice:
    return slice(JOINTS_PER_FINGER * finger, JOINTS_PER_FINGER * (finger + 1))
