"""What a hand has reported so far: frames in, the latest value of each message out."""

import math
from dataclasses import dataclass

import can
import numpy as np

from taxel.hand.allegro.errors import AllegroFrameError
from taxel.hand.allegro.joints import FINGERS, JOINT_COUNT, JOINTS_PER_FINGER
from taxel.hand.allegro.messages import FingerPose, HandInfo, Imu, Serial, Temperature
from taxel.hand.allegro.protocol import decode, device_of
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class JointReading:
    """The latest joint angles.

    angles: f64[16], radians; NaN for a finger that has not reported yet.
    age_s: seconds on the driver's clock since the oldest finger's frame was taken from the bus; infinite if a finger
        has not reported.
    is_complete: whether all four fingers have reported since the last reading.
    """

    angles: FloatArray
    age_s: float
    is_complete: bool


@dataclass(frozen=True)
class FrameCounts:
    """Frames from the bus: `taken` from this hand, `ignored` of others or not for the host, `malformed`."""

    taken: int = 0
    ignored: int = 0
    malformed: int = 0


class Reports:
    """The latest reports of the hand with id `device_id`; None or NaN before the first."""

    def __init__(self, device_id: int) -> None:
        self.device_id = device_id
        self.info: HandInfo | None = None
        self.serial: Serial | None = None
        self.imu: Imu | None = None
        self.temperatures_c: dict[int, int] = {}
        self.posed_s = [-math.inf] * len(FINGERS)  # when each finger last reported
        self._angles: FloatArray = np.full(JOINT_COUNT, np.nan)
        self._fresh: set[int] = set()
        self._taken = self._ignored = self._malformed = 0

    def take(self, frame: can.Message, now_s: float) -> None:
        """Take one frame of the bus, whatever it is. What is not understood is counted."""
        if device_of(frame) != self.device_id:
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
                self.posed_s[finger] = now_s
                self._fresh.add(finger)
            case HandInfo():
                self.info = message
            case Serial():
                self.serial = message
            case Imu():
                self.imu = message
            case Temperature(sensor, celsius):
                self.temperatures_c[sensor] = celsius
            case _:  # a command or a request that another program sends to this hand
                self._ignored += 1
                return
        self._taken += 1

    def read_angles(self, now_s: float) -> JointReading:
        """The latest angles; the next reading is complete once all fingers have reported again."""
        is_complete = len(self._fresh) == len(FINGERS)
        self._fresh.clear()
        return JointReading(self._angles.copy(), now_s - min(self.posed_s), is_complete)

    @property
    def frames(self) -> FrameCounts:
        """Frames so far."""
        return FrameCounts(self._taken, self._ignored, self._malformed)
