"""The driver of a right Allegro hand on a CAN channel."""

import contextlib
import time
from collections.abc import Callable
from types import TracebackType
from typing import Final, Self, TypeVar

import can
import numpy as np
import numpy.typing as npt

from taxel.hand.allegro.errors import (
    AllegroBusError,
    AllegroCommunicationError,
    AllegroLeftHandError,
    AllegroPoseError,
    AllegroServoOffError,
    AllegroSilentError,
    AllegroTemperatureError,
)
from taxel.hand.allegro.joints import (
    FINGERS,
    JOINT_COUNT,
    JOINT_MAX_RAD,
    JOINT_MIN_RAD,
    JOINT_NAMES,
    sixteen,
)
from taxel.hand.allegro.messages import (
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
)
from taxel.hand.allegro.protocol import encode
from taxel.hand.allegro.reports import FrameCounts, JointReading, Reports

POSITION_PERIOD_MS: Final = 3  # the maker's usual control period
SILENCE_LIMIT_S: Final = 0.1
ANSWER_TIMEOUT_S: Final = 0.5
INFO_PERIOD_S: Final = 0.5
_WAIT_S = 0.001  # grain of waiting for an answer
_MIN_PERIODS_OF_SILENCE = 3  # fewer could be one late frame
_SEND_TIMEOUT_S = 0.1
_SERVO_ATTEMPTS = 10
_SERVO_PAUSE_S = 0.01
_IDS = {HandInfo: MessageId.HAND_INFO, Serial: MessageId.SERIAL}

_T = TypeVar("_T")
_Reply = TypeVar("_Reply", HandInfo, Serial)


class AllegroHand:
    """A right Allegro hand V4; a context manager.

    bus: an open channel at 1 Mbit/s (`open_bus`); stays the caller's.
    device_id: 0 to 3. clock: seconds; virtual seconds in lock step.
    advance: what to do while an answer is awaited, given seconds to let pass. Default: wait on the bus in real time.
        In lock step it steps the virtual hand, so that one thread suffices and nothing sleeps.
    silence_limit_s: `update` raises AllegroSilentError when a finger has not reported for longer; never less than three
        position periods. answer_timeout_s: how long an answer is awaited. info_period_s: how often the status is asked.

    On entry the hand is asked what it is (a left hand, a fault or no answer are errors), the periods are set to
    (`position_ms`, 0, 0), demands to zero, and the motors go on. On exit, also after an error, demands go to zero and
    the motors off.

    Every method may raise AllegroBusError; those that read raise what the hand reports: AllegroTemperatureError,
    AllegroServoOffError, AllegroCommunicationError, AllegroSilentError. Not thread-safe.
    """

    def __init__(
        self,
        bus: can.BusABC,
        device_id: int = 0,
        clock: Callable[[], float] = time.monotonic,
        *,
        advance: Callable[[float], object] | None = None,
        position_ms: int = POSITION_PERIOD_MS,
        silence_limit_s: float = SILENCE_LIMIT_S,
        answer_timeout_s: float = ANSWER_TIMEOUT_S,
        info_period_s: float = INFO_PERIOD_S,
    ) -> None:
        if not (silence_limit_s > 0 and answer_timeout_s > 0 and info_period_s > 0):
            raise ValueError("silence_limit_s, answer_timeout_s and info_period_s: expected more than 0")
        encode(SystemOff(), device_id)  # refuses a device id out of range
        self.channel = str(bus.channel_info)
        self.device_id = device_id
        self._bus, self._clock, self._advance = bus, clock, advance
        self._start_period_ms = position_ms
        self._silence_limit_s, self._answer_timeout_s = silence_limit_s, answer_timeout_s
        self._info_period_s = info_period_s
        self._is_on = False
        self._position_ms = 0
        self._reports = Reports(device_id)
        self._quiet_since_s = 0.0
        self._asked_s = 0.0

    def __enter__(self) -> Self:
        try:
            self._check(self._ask(HandInfo))
            self._ask(Serial)
            self.set_period(self._start_period_ms)
            self._switch_on()
        except BaseException:
            with contextlib.suppress(AllegroBusError):
                self._switch_off()
            raise
        self._quiet_since_s = self._clock()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._switch_off()
        except AllegroBusError:
            if error is None:  # an error on its way out says more
                raise

    def set_torque(self, demand: npt.ArrayLike) -> None:
        """Send torque demands: f64[16], shares of full PWM, clipped to -1 .. 1. Raises ValueError for a wrong shape or
        a value that is not finite.
        """
        values = sixteen("demand", demand).tolist()
        for finger in range(len(FINGERS)):
            self._send(SetTorque(finger, _of_finger(values, finger)))

    def set_pose(self, angles: npt.ArrayLike) -> None:
        """Send wanted joint angles: f64[16], radians. The maker's V4 manual calls this message not implemented: use
        torque control on a real hand. Raises AllegroPoseError outside the joint ranges, ValueError for a wrong shape.
        """
        wanted = sixteen("angles", angles)
        outside = np.flatnonzero((wanted < JOINT_MIN_RAD) | (wanted > JOINT_MAX_RAD))
        if outside.size:
            j = int(outside[0])
            found = f"{JOINT_NAMES[j]}: expected {JOINT_MIN_RAD[j]:g} to {JOINT_MAX_RAD[j]:g} rad, found {wanted[j]:g}"
            raise AllegroPoseError(self.channel, self.device_id, f"{found}; nothing was sent, keep to the joint range")
        values = wanted.tolist()
        for finger in range(len(FINGERS)):
            self._send(SetPose(finger, _of_finger(values, finger)))

    def set_period(self, position_ms: int, imu_ms: int = 0, temperature_ms: int = 0) -> None:
        """Set how often the hand reports, whole milliseconds; 0 is never. Raises ValueError outside 0 to 65535.

        With a position period of 0 the hand is not missed when it is silent; ask with `request_poses`.
        """
        self._send(SetPeriod(position_ms, imu_ms, temperature_ms))
        self._position_ms = position_ms
        self._quiet_since_s = self._clock()

    def request_poses(self) -> None:
        """Ask all four fingers for their pose, once."""
        for finger in range(len(FINGERS)):
            self._send(Request(MessageId.FINGER_POSE, finger))

    def poll(self, timeout_s: float = 0.0) -> int:
        """Take all frames that are there, waiting at most `timeout_s` seconds for the first one.

        Returns their number, those of others included. Frames that are not understood are counted, never fatal.
        """
        number = 0
        while (frame := self._receive(0.0 if number else timeout_s)) is not None:
            number += 1
            self._reports.take(frame, self._clock())
        return number

    def update(self, timeout_s: float = 0.0) -> int:
        """`poll`, then raise what is wrong: a fault that the hand reports, or silence. Asks for the status in time."""
        number = self.poll(timeout_s)
        now_s = self._clock()
        if self._is_on and now_s - self._asked_s >= self._info_period_s:
            self._request(HandInfo)  # before anything is raised: a fault that has passed must be seen to have passed
        if self._reports.info is not None:
            self._check(self._reports.info)
        if self._is_on:
            self._check_silence(now_s)
        return number

    def read_joint_angles(self) -> JointReading:
        """The latest joint angles that `poll` or `update` has taken, with their age."""
        return self._reports.read_angles(self._clock())

    def get_info(self) -> HandInfo:
        """What the hand last said of itself. Raises AllegroSilentError if it has not been asked or not answered."""
        return self._known(self._reports.info, "hand info")

    def get_serial(self) -> str:
        """The serial number. Raises AllegroSilentError if it has not been asked or not answered."""
        return self._known(self._reports.serial, "serial number").text

    @property
    def imu(self) -> Imu | None:
        """The last report of the IMU; None before the first."""
        return self._reports.imu

    @property
    def temperatures_c(self) -> dict[int, int]:
        """The last report of each temperature sensor, degrees Celsius, by sensor."""
        return dict(self._reports.temperatures_c)

    @property
    def frames(self) -> FrameCounts:
        """Frames taken, ignored and malformed so far."""
        return self._reports.frames

    def _ask(self, kind: type[_Reply]) -> _Reply:
        """Request a message and wait for it."""
        if kind is HandInfo:
            self._reports.info = None
        else:
            self._reports.serial = None
        self._request(kind)
        begun_s = self._clock()
        quiet = 0  # a clock that nobody moves must not wait for ever
        while self._clock() - begun_s <= self._answer_timeout_s and quiet * _WAIT_S <= self._answer_timeout_s:
            if self._advance is not None:
                self._advance(_WAIT_S)
            quiet += not self.poll(0.0 if self._advance is not None else _WAIT_S)
            answer = self._reports.info if kind is HandInfo else self._reports.serial
            if isinstance(answer, kind):
                return answer
        raise self._silent(f"no answer to {_IDS[kind].name} in {self._answer_timeout_s:g} s")

    def _request(self, kind: type[HandInfo] | type[Serial]) -> None:
        if kind is HandInfo:
            self._asked_s = self._clock()
        self._send(Request(_IDS[kind]))

    def _switch_on(self) -> None:
        self.set_torque(np.zeros(JOINT_COUNT))  # or the demands of an earlier program could come alive
        self._is_on = True  # before it is sent: whatever happens next, the motors are switched off again
        self._send(SystemOn())
        for _ in range(_SERVO_ATTEMPTS):  # the motors may take a moment
            if self._ask(HandInfo).servo_on:
                break
            (self._advance or time.sleep)(_SERVO_PAUSE_S)
        self._check(self.get_info())

    def _check(self, info: HandInfo) -> None:
        where = self.channel, self.device_id
        if info.hand_type != 0:
            raise AllegroLeftHandError(
                *where, f"expected a right hand (type 0), found type {info.hand_type}; connect the right hand"
            )
        if info.high_temperature:
            raise AllegroTemperatureError(
                *where, f"high temperature fault at {info.temperature_c} C; remove the load and let the hand cool"
            )
        if info.communication_fault:
            raise AllegroCommunicationError(
                *where, "internal communication fault; switch the hand's power off and on, then check its finger cables"
            )
        if self._is_on and not info.servo_on:
            raise AllegroServoOffError(
                *where, "expected the motors on, found them off; check the hand's power supply, then open it again"
            )

    def _check_silence(self, now_s: float) -> None:
        if not self._position_ms:
            return
        limit_s = max(self._silence_limit_s, _MIN_PERIODS_OF_SILENCE * self._position_ms / 1000)
        ages = [now_s - max(at_s, self._quiet_since_s) for at_s in self._reports.posed_s]
        silent = [name for name, age_s in zip(FINGERS, ages, strict=True) if age_s > limit_s]
        if silent:
            raise self._silent(f"no pose of {', '.join(silent)} for {max(ages):.3f} s (limit {limit_s:g} s)")

    def _silent(self, problem: str) -> AllegroSilentError:
        return AllegroSilentError(
            self.channel, self.device_id, f"{problem}; check power, CAN cable, termination, bit rate and device id"
        )

    def _known(self, value: _T | None, name: str) -> _T:
        if value is None:
            raise self._silent(f"no {name} yet; open the hand with 'with'")
        return value

    def _switch_off(self) -> None:
        was_on, self._is_on = self._is_on, False
        if not was_on:
            return
        try:
            self.set_torque(np.zeros(JOINT_COUNT))
        finally:  # motors off even where a demand could not be sent
            self._send(SystemOff())

    def _send(self, message: Message) -> None:
        frame = encode(message, self.device_id)
        try:
            self._bus.send(frame, timeout=_SEND_TIMEOUT_S)
        except (can.CanError, OSError) as error:
            raise self._bus_error("sent", error) from error

    def _receive(self, timeout_s: float) -> can.Message | None:
        try:
            return self._bus.recv(timeout_s)
        except (can.CanError, OSError) as error:
            raise self._bus_error("received", error) from error

    def _bus_error(self, done: str, error: Exception) -> AllegroBusError:
        reason = " ".join(str(error).split()) or type(error).__name__
        return AllegroBusError(
            self.channel, self.device_id, f"nothing can be {done} ({reason}); check adapter, cable and termination"
        )


def _of_finger(values: list[float], finger: int) -> tuple[float, float, float, float]:
    a, b, c, d = values[4 * finger : 4 * finger + 4]
    return a, b, c, d
