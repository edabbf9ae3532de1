"""One grasp of the emulated hand: a virtual Allegro on CAN closes on an object that stands a little elsewhere."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import can
import numpy as np
from numpy.typing import NDArray

from taxel.campaign.grasping import PERIOD_S, JointLog, perform
from taxel.campaign.hand_in_contact import HandInContact
from taxel.grasp.controller import GraspController
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand.allegro.driver import AllegroHand
from taxel.hand.allegro.virtual import VirtualAllegro

RECORD_PERIODS = 3
"""Periods between two records of the scene: 9 ms."""

SETTLE_S = 0.12
"""Control before the fingers close: the held joints take up their load."""

_channels = itertools.count()


@dataclass(frozen=True, eq=False)
class Motion:
    """What truly happened. time_s: [k], since the grasp began; object_poses: [k, 4, 4]; bracket_poses: [k, s, 4, 4], in
    the world, brackets as they are believed to be fixed. joints: what the encoders said.
    """

    time_s: NDArray[np.float64]
    object_poses: NDArray[np.float64]
    bracket_poses: NDArray[np.float64]
    joints: JointLog


def move(
    dynamics: HandInContact,
    controller: GraspController,
    timeline: Timeline,
    wrist_at: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> Motion:
    """Approach, close, hold, open and withdraw: the virtual hand answers its driver in lock step, in virtual time.

    wrist_at: where the arm holds the wrist at times [k] of the grasp, f64[k, 4, 4]. Before and after nothing moves: the
    first and last record stand for the baseline and the recovery.
    """
    begin = max(0.0, timeline.begin(Phase.CLOSING) - SETTLE_S)
    ticks = round((timeline.end(Phase.RELEASE) - begin) / PERIOD_S)
    wrists = wrist_at(begin + PERIOD_S * np.arange(ticks, dtype=np.float64))
    times: list[float] = []
    objects: list[NDArray[np.float64]] = []
    brackets: list[NDArray[np.float64]] = []

    def watch(time_s: float) -> None:
        tick = round((time_s - begin) / PERIOD_S)
        dynamics.hold_wrist(wrists[min(tick, ticks - 1)])
        if tick % RECORD_PERIODS == 0:
            times.append(time_s)
            objects.append(dynamics.object_pose())
            brackets.append(dynamics.bracket_poses())

    periods = itertools.count()

    def wait() -> int:
        virtual.step(PERIOD_S)
        return next(periods)

    channel = f"taxel-campaign-{next(_channels)}"
    with can.Bus(interface="virtual", channel=channel) as ours, can.Bus(interface="virtual", channel=channel) as theirs:
        virtual = VirtualAllegro(theirs, dynamics)
        with AllegroHand(ours, clock=lambda: virtual.time_s, advance=virtual.step) as hand:
            joints = perform(hand, controller, begin, timeline.end(Phase.RELEASE), wait, watch)
    return Motion(np.array(times), np.stack(objects), np.stack(brackets), joints)
