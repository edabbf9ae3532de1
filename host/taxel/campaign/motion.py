"""Motion of one grasp of the emulated hand: a virtual Allegro hand on CAN closes on an object and touches it."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.grasp_control import PERIOD_S, JointLog, control_grasp
from taxel.campaign.hand_in_contact import HandInContact
from taxel.grasp.controller import GraspController
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.allegro.driver import AllegroHand
from taxel.hand.allegro.paired_bus import PairedBus
from taxel.hand.allegro.virtual import VirtualAllegro

RECORD_PERIODS = 3
"""Control periods between two records of the scene: 9 ms."""

SETTLE_S = 0.12
"""Time under control before the fingers close, in which the position-controlled joints take up their load."""


@dataclass(frozen=True, eq=False)
class Motion:
    """True motion of one grasp.

    time_s: f64[k], times of the k records of the scene, seconds since the start of the grasp. object_poses: f64[k, 4,
    4], world. bracket_poses: f64[k, s, 4, 4] of the s boards' brackets, world, nominal: without the offsets of their
    mounting. joints: the measured joint angles of the hand.
    """

    time_s: NDArray[np.float64]
    object_poses: NDArray[np.float64]
    bracket_poses: NDArray[np.float64]
    joints: JointLog

    def select_hold(self, timeline: Timeline) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the poses of object f64[h, 4, 4] and brackets f64[h, s, 4, 4] at the h recorded times of the hold."""
        is_hold = timeline.find_phases(self.time_s) == Phase.HOLD
        return self.object_poses[is_hold], self.bracket_poses[is_hold]


def simulate_grasp_motion(
    dynamics: HandInContact,
    controller: GraspController,
    timeline: Timeline,
    wrist_at: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> Motion:
    """Simulate the motion of one grasp in virtual time: approach, close, hold, open and withdraw.

    The virtual hand and the driver of the real hand exchange messages on a virtual CAN bus. wrist_at: returns the wrist
    poses f64[k, 4, 4], world, at k times f64[k], seconds since the start of the grasp. The scene is at rest in the
    baseline and in the recovery, and the motion has no records there: the first record applies to the baseline, and the
    last record to the recovery.
    """
    begin = max(0.0, timeline.get_start_s(Phase.CLOSING) - SETTLE_S)
    ticks = round((timeline.get_end_s(Phase.RELEASE) - begin) / PERIOD_S)
    wrists = wrist_at(begin + PERIOD_S * np.arange(ticks, dtype=np.float64))
    times: list[float] = []
    objects: list[NDArray[np.float64]] = []
    brackets: list[NDArray[np.float64]] = []

    def on_period(time_s: float) -> None:
        """Move the wrist to its pose at `time_s`, and record the poses of object and brackets at regular periods."""
        tick = round((time_s - begin) / PERIOD_S)
        dynamics.hold_wrist(wrists[min(tick, ticks - 1)])
        dynamics.steady_object(timeline.get_steadying(time_s))
        if tick % RECORD_PERIODS == 0:
            times.append(time_s)
            objects.append(dynamics.object_pose())
            brackets.append(dynamics.bracket_poses())

    periods = itertools.count()

    def wait_for_period() -> int:
        """Advance the virtual hand to its next report and return the number of the period.

        A control period begins at the report, because each report and each control command ends a time step of the
        simulation. If both occur at the same time, the simulation needs only half as many time steps.
        """
        virtual.step(min(virtual.next_report_s - virtual.time_s, PERIOD_S))
        return next(periods)

    host_bus, hand_bus = PairedBus.open_pair()
    with host_bus, hand_bus:
        virtual = VirtualAllegro(hand_bus, dynamics)
        with AllegroHand(host_bus, clock=lambda: virtual.time_s, advance=virtual.step) as hand:
            joints = control_grasp(
                hand, controller, begin, timeline.get_end_s(Phase.RELEASE), wait_for_period, on_period
            )
    return Motion(np.array(times), np.stack(objects), np.stack(brackets), joints)
