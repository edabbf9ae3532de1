"""Joint angles from the reports of an Allegro hand on CAN, without control of its motors."""

import threading
import time
from collections.abc import Sequence
from typing import Final

import can
import numpy as np

from taxel.hand.allegro.joints import FINGERS, JOINT_COUNT
from taxel.hand.allegro.messages import SetPeriod
from taxel.hand.allegro.protocol import encode
from taxel.hand.allegro.reports import Reports
from taxel.hand.joint_history import MAX_SAMPLES, JointHistory
from taxel.hand.joint_names import ROBOT_JOINT_NAMES
from taxel.types import FloatArray

PERIOD_MS: Final = 3


class AllegroListener:
    """Thread that collects the joint angles of a hand while another program controls the hand, or with motors off.

    history: samples on the clock of `time.monotonic`. The listener requests reports every 3 ms at its start; it never
    switches the motors and never sends torques. base: angles of all joints of the robot, radians, of which the 16
    joints of the hand are replaced.
    """

    def __init__(self, bus: can.BusABC, names: Sequence[str], base: FloatArray, device_id: int = 0) -> None:
        """Start to listen on an open channel, which the caller shuts down after `close`.

        names: joints of the robot. base: angles of all joints of the robot, radians; each sample contains them for the
        joints that the hand does not report. Raises ValueError if the robot lacks a joint of the hand.
        """
        self._index = [list(names).index(name) for name in ROBOT_JOINT_NAMES]
        self._bus, self._base = bus, np.array(base, dtype=np.float64)
        self._reports = Reports(device_id)
        self.history = JointHistory(names, str(bus.channel_info), MAX_SAMPLES)
        self.history.is_live = True
        self._stop = threading.Event()
        bus.send(encode(SetPeriod(PERIOD_MS, 0, 0), device_id))
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        """Add a sample to the history after each set of reports of all fingers, until `close` or a channel failure."""
        while not self._stop.is_set():
            try:
                frame = self._bus.recv(0.05)
            except (can.CanError, OSError):
                return  # the history ends; its reader notices the missing samples
            if frame is None:
                continue
            now_s = time.monotonic()
            self._reports.take(frame, now_s)
            reading = self._reports.read_angles(now_s) if self._reports.reported_fingers == len(FINGERS) else None
            if reading is not None and np.isfinite(reading.angles).all():
                angles = self._base.copy()
                angles[self._index] = reading.angles[:JOINT_COUNT]
                self.history.add(now_s, angles)

    def close(self) -> None:
        """Stop the thread."""
        self._stop.set()
        self._thread.join()
