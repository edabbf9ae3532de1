"""Control loop of one grasp, with a period of 3 ms, for an emulated or a physical Allegro hand on CAN."""

import contextlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.controller import GraspController
from taxel.hand.allegro.driver import AllegroHand
from taxel.hand.allegro.errors import AllegroError
from taxel.hand.allegro.joints import JOINT_COUNT
from taxel.hand.allegro.virtual import MAX_TORQUE_NM

PERIOD_S = 0.003
SPEED_FILTER_S = 0.009
"""Time constant of the joint speed filter: differences of encoder counts over one period are coarse."""


@dataclass(frozen=True, eq=False)
class JointLog:
    """Measured joint angles. time_s: f64[k], seconds since the start of the grasp; angles: f64[k, j], radians."""

    time_s: NDArray[np.float64]
    angles: NDArray[np.float64]

    def interpolate(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate the logged joint angles at `times_s` f64[T]: f64[T, j] radians.

        Outside the log, the result is its first or last angles.
        """
        columns = [np.interp(times_s, self.time_s, column) for column in self.angles.T]
        return np.column_stack(columns)


def control_grasp(
    hand: AllegroHand,
    controller: GraspController,
    begin_s: float,
    end_s: float,
    wait_for_period: Callable[[], int],
    on_period: Callable[[float], object] | None = None,
) -> JointLog:
    """Control the torques of the Allegro hand from `begin_s` to `end_s` seconds of a grasp; return the joint angles.

    wait_for_period: waits for the next control period and returns its number. Missed periods are counted, so that the
    number increases by more than 1 after them. The function is `ControlLoop.wait`, or it advances a virtual hand.
    on_period: called in each period with the time since the start of the grasp, seconds. All torques are zero at the
    end, also after an error. Errors of the driver (`AllegroError`) are raised at once.
    """
    try:
        log = _run_control_loop(hand, controller, begin_s, end_s, wait_for_period, on_period or (lambda _: None))
    except BaseException:
        with contextlib.suppress(AllegroError):  # the first error is the more informative one
            hand.set_torque(np.zeros(JOINT_COUNT))
        raise
    hand.set_torque(np.zeros(JOINT_COUNT))
    return log


def _run_control_loop(
    hand: AllegroHand,
    controller: GraspController,
    begin_s: float,
    end_s: float,
    wait_for_period: Callable[[], int],
    on_period: Callable[[float], object],
) -> JointLog:
    """Run the control loop of a grasp from `begin_s` to `end_s` seconds; the torques of the last period stay set.

    wait_for_period: waits for the next control period and returns its number. on_period: called in each period with the
    time since the start of the grasp, seconds. Returns the joint angles of all periods.
    """
    first, angles = _wait_for_first_report(hand, wait_for_period)
    period, speeds = first, np.zeros_like(angles)
    times, angle_log = [], []
    while period - first < round((end_s - begin_s) / PERIOD_S):
        time_s = begin_s + (period - first) * PERIOD_S
        times.append(time_s)
        angle_log.append(angles)
        hand.set_torque(controller.compute_torque(time_s, angles, speeds) / MAX_TORQUE_NM)
        on_period(time_s)
        previous, period = period, wait_for_period()
        hand.update()
        latest, elapsed_s = hand.read_joint_angles().angles, (period - previous) * PERIOD_S
        # Low-pass filter of first order, because the encoder angles of one period resolve the speed only coarsely.
        speeds += min(elapsed_s / SPEED_FILTER_S, 1.0) * ((latest - angles) / elapsed_s - speeds)
        angles = latest
    return JointLog(np.array(times), np.array(angle_log))


def _wait_for_first_report(hand: AllegroHand, wait_for_period: Callable[[], int]) -> tuple[int, NDArray[np.float64]]:
    """Wait until every finger of the hand has reported its angles; return the number of this period and the angles.

    If a finger never reports, `hand.update()` raises the error of the driver.
    """
    while True:
        period = wait_for_period()
        hand.update()
        angles = hand.read_joint_angles().angles
        if np.isfinite(angles).all():
            return period, angles
