"""Latest value of each report of a hand, from received CAN frames."""

import math
from dataclasses import dataclass

import can
import numpy as np

from taxel.hand.allegro.errors import AllegroFrameError
from taxel.hand.allegro.joints import FINGERS, JOINT_COUNT, JOINTS_PER_FINGER
from taxel.hand.allegro.messages import FingerPose, HandInfo, Imu, Serial, Temperature
from taxel.hand.allegro.protocol import decode, get_device_id
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class JointReading:
    """Latest joint angles.

    angles: f64[16], radians; NaN for a finger without a report.
    age_s: age of the oldest finger report on the driver's clock, seconds; infinite if a finger has not reported.
    is_complete: whether all four fingers have reported since the previous reading.
    """

    angles: FloatArray
    age_s: float
    is_complete: bool


@dataclass(frozen=True)
class FrameCounts:
    """Numbers of received frames.

    accepted: reports of this hand. ignored: frames of other devices, and commands of other programs to this hand.
    malformed: frames of this hand with invalid content.
    """

    accepted: int = 0
    ignored: int = 0
    malformed: int = 0


class Reports:
    """Latest reports of the hand with id `device_id`; None or NaN before the first."""

    def __init__(self, device_id: int) -> None:
        """Create an empty store for the latest reports of the Allegro hand with this device id; all angles are NaN."""
        self.device_id = device_id
        self.info: HandInfo | None = None
        self.serial: Serial | None = None
        self.imu: Imu | None = None
        self.temperatures_c: dict[int, int] = {}
        self.pose_time_s = [-math.inf] * len(FINGERS)  # time of the latest report of each finger
        self._angles: FloatArray = np.full(JOINT_COUNT, np.nan)
        self._reported_fingers: set[int] = set()
        self._accepted = self._ignored = self._malformed = 0

    def take(self, frame: can.Message, now_s: float) -> None:
        """Store the report in a frame that was received at `now_s` seconds; other and malformed frames are counted."""
        if get_device_id(frame) != self.device_id:
            self._ignored += 1
            return
        try:
            message = decode(frame)
        except AllegroFrameError:
            self._malformed += 1
            return
        match message:
            case FingerPose(finger, angles):
                first = JOINTS_PER_FINGER * finger
                self._angles[first : first + JOINTS_PER_FINGER] = angles
                self.pose_time_s[finger] = now_s
                self._reported_fingers.add(finger)
            case HandInfo():
                self.info = message
            case Serial():
                self.serial = message
            case Imu():
                self.imu = message
            case Temperature(sensor, celsius):
                self.temperatures_c[sensor] = celsius
            case _:  # a command or a request of another program to this hand
                self._ignored += 1
                return
        self._accepted += 1

    @property
    def reported_fingers(self) -> int:
        """Number of fingers that have reported since the latest reading."""
        return len(self._reported_fingers)

    def read_angles(self, now_s: float) -> JointReading:
        """Return the latest angles at `now_s` seconds.

        The call also starts the next reading. A reading is complete if all fingers have reported since it started.
        """
        is_complete = len(self._reported_fingers) == len(FINGERS)
        self._reported_fingers.clear()
        return JointReading(self._angles.copy(), now_s - min(self.pose_time_s), is_complete)

    @property
    def frames(self) -> FrameCounts:
        """Numbers of accepted, ignored and malformed CAN frames."""
        return FrameCounts(self._accepted, self._ignored, self._malformed)
