"""Allegro control loop in real time: driver, joint PD controller and a virtual hand on python-can's virtual bus.

    python tools/bench/bench_control_loop.py [seconds]

The virtual hand runs in a thread of the same process and shares its interpreter, so the loop has less load with a
physical hand.
"""

import json
import sys
import threading

import can
import numpy as np
from figures import Figure

from taxel.hand.allegro import AllegroHand, FreeJoints, VirtualAllegro
from taxel.hand.control_loop import ControlLoop

PERIOD_S = 0.003
# Fraction of full PWM per rad and per rad/s; chosen for the free joints of the virtual hand.
STIFFNESS, DAMPING = 4.0, 0.08
SWAY_RAD, SWAY_HZ = 0.1, 0.5
ANSWER_TIMEOUT_S = 5.0  # a busy machine must not count as a hand that does not respond
_CHANNEL = "bench_control_loop"


def _run_controller(hand: AllegroHand, seconds: float) -> dict[str, float]:
    """Run the joint controller for `seconds`; return statistics of its periods and the number of complete readings."""
    loop = ControlLoop(PERIOD_S)
    while not np.isfinite(hand.read_joint_angles().angles).all():  # until the hand has sent every joint angle
        hand.update(PERIOD_S)
    start_angles = last = hand.read_joint_angles().angles
    complete = 0

    def run_period(period: int) -> None:
        """Run one control period: read the joint angles, and set torques that follow a swaying target pose."""
        nonlocal last, complete
        hand.update()
        reading = hand.read_joint_angles()
        complete += reading.is_complete
        target = start_angles + SWAY_RAD * np.sin(2 * np.pi * SWAY_HZ * period * PERIOD_S)
        hand.set_torque(STIFFNESS * (target - reading.angles) - DAMPING * (reading.angles - last) / PERIOD_S)
        last = reading.angles

    statistics = loop.run(run_period, round(seconds / PERIOD_S))
    return {
        "periods": statistics.periods + statistics.missed,
        "missed": statistics.missed,
        "p50_us": round(1e6 * statistics.p50_s, 1),
        "p99_us": round(1e6 * statistics.p99_s, 1),
        "max_us": round(1e6 * statistics.max_s, 1),
        "complete_pose_sets": complete,
    }


def measure() -> list[Figure]:
    """Run the benchmark of the joint controller.

    Returns the share of the control periods that were met, relative to an empty loop.
    """
    loop = count_periods()
    met, empty = loop["periods"] - loop["missed"], loop["periods"] - loop["empty_loop_missed"]
    detail = f"333 Hz: {loop['missed']:.0f} of {loop['periods']:.0f} missed, empty loop {loop['empty_loop_missed']:.0f}"
    return [Figure("Allegro control loop, periods met", met / max(empty, 1.0), None, "an empty loop", detail)]


def count_periods(seconds: float = 5.0) -> dict[str, float]:
    """Run the joint controller with a virtual hand for `seconds` and count its control periods.

    Returns the statistics of the controller (periods, missed periods, lateness in us, complete readings). The key
    `empty_loop_missed` is the number of periods that a loop without a controller, of the same duration, misses directly
    afterwards: on a busy computer, such a loop misses periods, too.
    """
    statistics = _run_with_virtual_hand(seconds)
    empty = ControlLoop(PERIOD_S).run(lambda period: None, round(seconds / PERIOD_S))
    return statistics | {"empty_loop_missed": empty.missed}


def _run_with_virtual_hand(seconds: float) -> dict[str, float]:
    """Run the controller against a virtual hand in a second thread; return the statistics of `_run_controller`."""
    host_end, hand_end = can.Bus(_CHANNEL, "virtual"), can.Bus(_CHANNEL, "virtual")
    stop = threading.Event()
    thread = threading.Thread(target=VirtualAllegro(hand_end, FreeJoints()).run, args=(stop,))
    thread.start()
    try:
        with AllegroHand(host_end, reply_timeout_s=ANSWER_TIMEOUT_S, silence_limit_s=ANSWER_TIMEOUT_S) as hand:
            return _run_controller(hand, seconds)
    finally:
        stop.set()
        thread.join()
        host_end.shutdown()
        hand_end.shutdown()


if __name__ == "__main__":
    print(json.dumps(count_periods(float(sys.argv[1]) if len(sys.argv) > 1 else 5.0), indent=2))
