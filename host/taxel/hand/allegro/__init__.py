"""The right Allegro hand V4 on CAN: protocol, driver and virtual hand.

>>> import can
>>> host_end, hand_end = open_bus("can:virtual:example"), can.Bus("example", "virtual")
>>> virtual = VirtualAllegro(hand_end, FreeJoints())
>>> with AllegroHand(host_end, clock=lambda: virtual.time_s, advance=virtual.step) as hand:
...     hand.set_torque([0.2] * 16)
...     virtual.step(0.003)
...     hand.update()
...     hand.read_joint_angles().is_complete
4
True
>>> host_end.shutdown(), hand_end.shutdown()
(None, None)
"""

from taxel.hand.allegro.bus import open_bus
from taxel.hand.allegro.driver import AllegroHand
from taxel.hand.allegro.dynamics import FreeJoints, JointDynamics
from taxel.hand.allegro.errors import (
    AllegroBusError,
    AllegroCommunicationError,
    AllegroError,
    AllegroFrameError,
    AllegroLeftHandError,
    AllegroPoseError,
    AllegroServoOffError,
    AllegroSilentError,
    AllegroTemperatureError,
    CanUrlError,
)
from taxel.hand.allegro.joints import FINGERS, JOINT_COUNT, JOINT_MAX_RAD, JOINT_MIN_RAD, JOINT_NAMES
from taxel.hand.allegro.messages import HandInfo
from taxel.hand.allegro.reports import FrameCounts, JointReading
from taxel.hand.allegro.virtual import VirtualAllegro, VirtualFaults

__all__ = [
    "FINGERS",
    "JOINT_COUNT",
    "JOINT_MAX_RAD",
    "JOINT_MIN_RAD",
    "JOINT_NAMES",
    "AllegroBusError",
    "AllegroCommunicationError",
    "AllegroError",
    "AllegroFrameError",
    "AllegroHand",
    "AllegroLeftHandError",
    "AllegroPoseError",
    "AllegroServoOffError",
    "AllegroSilentError",
    "AllegroTemperatureError",
    "CanUrlError",
    "FrameCounts",
    "FreeJoints",
    "HandInfo",
    "JointDynamics",
    "JointReading",
    "VirtualAllegro",
    "VirtualFaults",
    "open_bus",
]
