"""Driver of a right Allegro hand on a CAN channel."""

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
    check_joint_values,
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

POSITION_PERIOD_MS: Final = 3  # usual control period of the manufacturer
SILENCE_LIMIT_S: Final = 0.1
REPLY_TIMEOUT_S: Final = 0.5
INFO_PERIOD_S: Final = 0.5
_WAIT_STEP_S = 0.001  # time step while waiting for a reply
_MIN_PERIODS_OF_SILENCE = 3  # fewer periods may be caused by one late frame
_SEND_TIMEOUT_S = 0.1
_SERVO_ATTEMPTS = 10
_SERVO_PAUSE_S = 0.01
_IDS = {HandInfo: MessageId.HAND_INFO, Serial: MessageId.SERIAL}

_T = TypeVar("_T")
_Reply = TypeVar("_Reply", HandInfo, Serial)


class AllegroHand:
    """Driver of a right Allegro hand V4; a context manager.

    bus: open channel at 1 Mbit/s (`open_bus`); the caller shuts it down.
    device_id: 0 to 3. clock: returns seconds; virtual seconds in lock step.
    advance: function that lets the given seconds elapse while the driver waits for a reply; default: real time. In lock
        step it advances the virtual hand, so that a single thread suffices.
    silence_limit_s: `update` raises AllegroSilentError if a finger has not reported for longer, but not before three
        position periods. reply_timeout_s: time limit of a reply. info_period_s: period of status requests.

    On entry the driver requests the hand info (a left hand, a fault or a missing reply raises an error), sets the
    periods to (`position_ms`, 0, 0) and the torques to 0, and switches the motors on. On exit, also after an error, it
    sets the torques to 0 and switches the motors off.

    Every method may raise AllegroBusError. `update` and the entry raise the faults reported by the hand:
    AllegroTemperatureError, AllegroServoOffError, AllegroCommunicationError, AllegroSilentError. Not thread-safe.
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
        reply_timeout_s: float = REPLY_TIMEOUT_S,
        info_period_s: float = INFO_PERIOD_S,
    ) -> None:
        """Create the driver of an Allegro hand on an open CAN channel; nothing is sent before `__enter__`.

        bus: CAN channel, shut down by the caller. device_id: 0 to 3. clock: returns seconds. advance: function that
        lets the given number of seconds pass in virtual time; None: real time. position_ms: period of the position
        reports, ms. silence_limit_s: longest accepted time without a report of a finger. reply_timeout_s: time limit of
        a reply. info_period_s: period of the status requests. Raises ValueError for a time of 0 or less, or an invalid
        device id.
        """
        if not (silence_limit_s > 0 and reply_timeout_s > 0 and info_period_s > 0):
            raise ValueError("silence_limit_s, reply_timeout_s and info_period_s: expected values above 0")
        encode(SystemOff(), device_id)  # raises ValueError for an invalid device id
        self.channel = str(bus.channel_info)
        self.device_id = device_id
        self._bus, self._clock, self._advance = bus, clock, advance
        self._start_period_ms = position_ms
        self._silence_limit_s, self._reply_timeout_s = silence_limit_s, reply_timeout_s
        self._info_period_s = info_period_s
        self._is_on = False
        self._position_ms = 0
        self._reports = Reports(device_id)
        self._silence_start_s = 0.0
        self._info_request_s = 0.0

    def __enter__(self) -> Self:
        """Check the Allegro hand, set the period of its position reports, switch its motors on, and return the driver.

        If a step fails, the motors are switched off and the exception is raised again.
        """
        try:
            self._check(self._request_and_wait(HandInfo))
            self._request_and_wait(Serial)
            self.set_period(self._start_period_ms)
            self._switch_on()
        except BaseException:
            with contextlib.suppress(AllegroBusError):
                self._switch_off()
            raise
        self._silence_start_s = self._clock()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Switch the motors of the Allegro hand off; a bus error does not replace an earlier exception."""
        try:
            self._switch_off()
        except AllegroBusError:
            if error is None:  # an earlier exception is more informative
                raise

    def set_torque(self, torque: npt.ArrayLike) -> None:
        """Send torque commands: f64[16], fractions of full PWM, clipped to -1 .. 1.

        Raises ValueError for a wrong shape or a value that is not finite.
        """
        values = check_joint_values("torque", torque).tolist()
        for finger in range(len(FINGERS)):
            self._send(SetTorque(finger, _get_finger_values(values, finger)))

    def set_pose(self, angles: npt.ArrayLike) -> None:
        """Send target joint angles: f64[16], radians.

        The manufacturer's V4 manual lists this message as not implemented; use torque control on a physical hand.
        Raises AllegroPoseError outside the joint ranges, ValueError for a wrong shape.
        """
        target = check_joint_values("angles", angles)
        outside = np.flatnonzero((target < JOINT_MIN_RAD) | (target > JOINT_MAX_RAD))
        if outside.size:
            j = int(outside[0])
            problem = (
                f"{JOINT_NAMES[j]}: expected {JOINT_MIN_RAD[j]:g} to {JOINT_MAX_RAD[j]:g} rad, found {target[j]:g}"
            )
            raise AllegroPoseError(
                self.channel, self.device_id, f"{problem}; nothing was sent; keep within the joint range"
            )
        values = target.tolist()
        for finger in range(len(FINGERS)):
            self._send(SetPose(finger, _get_finger_values(values, finger)))

    def set_period(self, position_ms: int, imu_ms: int = 0, temperature_ms: int = 0) -> None:
        """Set the report periods, milliseconds, 0 to 65535; 0 disables a report. Raises ValueError outside this range.

        With a position period of 0, missing poses are no error; request them with `request_poses`.
        """
        self._send(SetPeriod(position_ms, imu_ms, temperature_ms))
        self._position_ms = position_ms
        self._silence_start_s = self._clock()

    def request_poses(self) -> None:
        """Request one report of the joint angles of all four fingers from the Allegro hand."""
        for finger in range(len(FINGERS)):
            self._send(Request(MessageId.FINGER_POSE, finger))

    def poll(self, timeout_s: float = 0.0) -> int:
        """Process all received frames, waiting at most `timeout_s` seconds for the first; return their number.

        Frames of other devices are included. Malformed frames are counted and cause no error.
        """
        number = 0
        while (frame := self._receive(0.0 if number else timeout_s)) is not None:
            number += 1
            self._reports.take(frame, self._clock())
        return number

    def update(self, timeout_s: float = 0.0) -> int:
        """Call `poll`, request the status when due, and return the number of processed frames.

        Raises an AllegroError for a fault in the latest hand info, and for a finger that has not reported in time.
        """
        number = self.poll(timeout_s)
        now_s = self._clock()
        if self._is_on and now_s - self._info_request_s >= self._info_period_s:
            self._request(HandInfo)  # before faults are raised, so that the end of a fault is noticed
        if self._reports.info is not None:
            self._check(self._reports.info)
        if self._is_on:
            self._check_silence(now_s)
        return number

    def read_joint_angles(self) -> JointReading:
        """Return the latest joint angles of the Allegro hand received by `poll` or `update`, with their age."""
        return self._reports.read_angles(self._clock())

    def get_info(self) -> HandInfo:
        """Return the latest hand info of the Allegro hand. Raises AllegroSilentError if none has been received."""
        return self._require_report(self._reports.info, "hand info")

    def get_serial(self) -> str:
        """Return the serial number of the Allegro hand. Raises AllegroSilentError if none has been received."""
        return self._require_report(self._reports.serial, "serial number").text

    @property
    def imu(self) -> Imu | None:
        """Latest report of the hand's IMU; None before the first report."""
        return self._reports.imu

    @property
    def temperatures_c(self) -> dict[int, int]:
        """Latest temperature of each sensor of the hand, degrees Celsius, by sensor number."""
        return dict(self._reports.temperatures_c)

    @property
    def frames(self) -> FrameCounts:
        """Numbers of accepted, ignored and malformed CAN frames."""
        return self._reports.frames

    def _request_and_wait(self, kind: type[_Reply]) -> _Reply:
        """Request a hand info or a serial number, and wait for the reply.

        Received frames are processed while waiting. Raises AllegroSilentError after `reply_timeout_s`.
        """
        if kind is HandInfo:
            self._reports.info = None
        else:
            self._reports.serial = None
        self._request(kind)
        start_s = self._clock()
        empty_polls = 0  # limits the wait if the clock does not advance
        while self._clock() - start_s <= self._reply_timeout_s and empty_polls * _WAIT_STEP_S <= self._reply_timeout_s:
            if self._advance is not None:
                self._advance(_WAIT_STEP_S)
            empty_polls += not self.poll(0.0 if self._advance is not None else _WAIT_STEP_S)
            reply = self._reports.info if kind is HandInfo else self._reports.serial
            if isinstance(reply, kind):
                return reply
        raise self._make_silent_error(f"no reply to {_IDS[kind].name} in {self._reply_timeout_s:g} s")

    def _request(self, kind: type[HandInfo] | type[Serial]) -> None:
        """Send a CAN request for a hand info or a serial number, and note the time of a hand info request."""
        if kind is HandInfo:
            self._info_request_s = self._clock()
        self._send(Request(_IDS[kind]))

    def _switch_on(self) -> None:
        """Switch the motors on with zero torque, and check the state of the hand."""
        self.set_torque(np.zeros(JOINT_COUNT))  # otherwise the torques of an earlier program could take effect
        self._is_on = True  # set before sending, so that the motors are switched off again after any error
        self._send(SystemOn())
        for _ in range(_SERVO_ATTEMPTS):  # the motors need some time
            if self._request_and_wait(HandInfo).servo_on:
                break
            (self._advance or time.sleep)(_SERVO_PAUSE_S)
        self._check(self.get_info())

    def _check(self, info: HandInfo) -> None:
        """Raise an AllegroError for a left hand, high temperature, a communication fault, or motors that went off."""
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
                *where, "internal communication fault; switch the hand off and on, then check its finger cables"
            )
        if self._is_on and not info.servo_on:
            raise AllegroServoOffError(
                *where, "expected the motors on, found them off; check the hand's power supply, then open it again"
            )

    def _check_silence(self, now_s: float) -> None:
        """Raise AllegroSilentError if a finger has sent no pose for longer than the limit.

        now_s: time on the driver's clock. Does nothing while periodic poses are disabled.
        """
        if not self._position_ms:
            return
        limit_s = max(self._silence_limit_s, _MIN_PERIODS_OF_SILENCE * self._position_ms / 1000)
        ages = [now_s - max(time_s, self._silence_start_s) for time_s in self._reports.pose_time_s]
        silent = [name for name, age_s in zip(FINGERS, ages, strict=True) if age_s > limit_s]
        if silent:
            raise self._make_silent_error(f"no pose of {', '.join(silent)} for {max(ages):.3f} s (limit {limit_s:g} s)")

    def _make_silent_error(self, problem: str) -> AllegroSilentError:
        """Create the error for a missing report of the hand; problem: the report and how long it has been missing."""
        return AllegroSilentError(
            self.channel, self.device_id, f"{problem}; check power, CAN cable, termination, bit rate and device id"
        )

    def _require_report(self, value: _T | None, name: str) -> _T:
        """Return `value`, the latest report called `name`; raise AllegroSilentError if it is None (no report yet)."""
        if value is None:
            raise self._make_silent_error(f"no {name} received; open the hand with 'with'")
        return value

    def _switch_off(self) -> None:
        """Switch the motors off after a command of zero torque. A second call has no effect."""
        was_on, self._is_on = self._is_on, False
        if not was_on:
            return
        try:
            self.set_torque(np.zeros(JOINT_COUNT))
        finally:  # motors off even if the torques could not be sent
            self._send(SystemOff())

    def _send(self, message: Message) -> None:
        """Send a message to the Allegro hand as a CAN frame. Raises AllegroBusError."""
        frame = encode(message, self.device_id)
        try:
            self._bus.send(frame, timeout=_SEND_TIMEOUT_S)
        except (can.CanError, OSError) as error:
            raise self._make_bus_error("send", error) from error

    def _receive(self, timeout_s: float) -> can.Message | None:
        """Return the next CAN frame, or None if no frame arrives within `timeout_s` seconds. Raises AllegroBusError."""
        try:
            return self._bus.recv(timeout_s)
        except (can.CanError, OSError) as error:
            raise self._make_bus_error("receive", error) from error

    def _make_bus_error(self, operation: str, error: Exception) -> AllegroBusError:
        """Create the error for a failed operation ("send" or "receive") of the CAN adapter; error: its cause."""
        reason = " ".join(str(error).split()) or type(error).__name__
        return AllegroBusError(
            self.channel,
            self.device_id,
            f"the bus cannot {operation} frames ({reason}); check adapter, cable and termination",
        )


def _get_finger_values(values: list[float], finger: int) -> tuple[float, float, float, float]:
    """Return the values of the four joints of finger number `finger` from a list of 16 joint values."""
    a, b, c, d = values[4 * finger : 4 * finger + 4]
    return a, b, c, d
