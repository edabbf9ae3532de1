"""Distribution of a force over several boards that carry a displaced object together.

The mount of the object (a fixture, a wrist, or the other fingers) is compliant across the direction of the push. If the
object is displaced laterally, boards at an angle push it aside until the mount balances them: one board carries more
force than in the simulation, and another board carries less. The force of each board changes, but the sum of the forces
along the direction of the push is constant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.types import FloatArray

MIN_NET_PUSH_RATIO: Final = 0.5
"""Smallest ratio of the net push to the sum of the pushes of all boards that push an object in one direction.

Chosen: below it the boards clamp the object between them.
"""

MIN_FORCE_SHARE: Final = 0.02
"""Smallest share of its simulated force that a board keeps.

Chosen: a board without force is a different contact, which a small displacement does not describe.
"""


@dataclass(frozen=True, eq=False)
class Push:
    """Force of one board on an object.

    number: index of the contact in `ContactGeometry.contacts`. force: net force, newtons. direction: f64[3], unit
    vector of the net force, object frame. place: f64[3], centre of the force, metres, object frame.
    """

    number: int
    force: float
    direction: FloatArray
    place: FloatArray


def find_coupled_pushes(conditions: Mapping[int, Sequence[Push]]) -> list[list[Push]]:
    """Return the pushes of each simulated contact in which several boards push an object in about the same direction.

    conditions: all pushes of each simulated contact, by its index. The result omits contacts with one board, and
    contacts in which the boards clamp the object between them (`MIN_NET_PUSH_RATIO`).
    """
    coupled = []
    for pushes in conditions.values():
        net = np.sum([push.force * push.direction for push in pushes], axis=0)
        if len(pushes) > 1 and np.linalg.norm(net) > MIN_NET_PUSH_RATIO * sum(push.force for push in pushes):
            coupled.append(list(pushes))
    return coupled


def compute_load_shifts(
    pushes: Sequence[Push], motions: Sequence[FloatArray], holding_stiffness: Sequence[float]
) -> dict[int, float]:
    """Return the increase of the net force of each board, newtons, by index of the contact (`Push.number`).

    pushes: forces of the boards that carry one object. motions: f64[4, 4] each, displacements of the boards in the
    object frame. holding_stiffness: stiffness of the object's mount across the push, newtons per metre, one value for
    each board.

    The computation has four steps:

    1. The motion of a board is the displacement of the centre of its force, along the direction of its force.
    2. The mount opposes this motion. The component of the force on the mount along the direction of the board is the
       stiffness times the motion. The force is the least-squares solution of these equations of all boards.
    3. Only the part of this force across the net push is kept.
    4. The changes of the boards' forces add up to this part (least squares). Of all such changes, the result has the
       smallest sum of squares. No board falls below `MIN_FORCE_SHARE` of its force.
    """
    directions = np.array([push.direction for push in pushes])
    net = np.array([push.force for push in pushes]) @ directions
    net_direction = net / np.linalg.norm(net)
    moved = np.array(
        [motion[:3, :3] @ push.place + motion[:3, 3] - push.place for push, motion in zip(pushes, motions, strict=True)]
    )
    mount_force = np.linalg.pinv(directions) @ (np.asarray(holding_stiffness) * (directions * moved).sum(axis=1))
    mount_force -= net_direction * (net_direction @ mount_force)
    changes = np.linalg.pinv(directions.T) @ mount_force
    return {
        push.number: max(float(change), (MIN_FORCE_SHARE - 1.0) * push.force)
        for push, change in zip(pushes, changes, strict=True)
    }
