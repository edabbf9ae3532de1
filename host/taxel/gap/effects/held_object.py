"""How boards share the force of an object that touches several of them and stands elsewhere.

What holds the object (a mount, a wrist, the other fingers) gives way a little across the push. An object that is held a
millimetre aside is pushed aside by boards that stand at an angle, until what holds it pushes back: one board bears
more than the simulator says, and another less. Each board's own force is no longer what it was, but their sum along
the push is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.types import FloatArray

ONE_WAY: Final = 0.5
"""Net push over the sum of all boards' pushes: below it they hold the object between them, and it is no press."""

LEAST_SHARE: Final = 0.02
"""Of its force that a board bears at least: one that is left alone is another contact, which no small motion tells."""


@dataclass(frozen=True, eq=False)
class Push:
    """What a board does to an object in a press. number: of the contact. force: newtons. direction, place: f64[3], its
    mean and where, object frame.
    """

    number: int
    force: float
    direction: FloatArray
    place: FloatArray


def pushes_together(conditions: Mapping[int, Sequence[Push]]) -> list[list[Push]]:
    """Of the cells those in which several boards push an object one way."""
    found = []
    for own in conditions.values():
        net = np.sum([one.force * one.direction for one in own], axis=0)
        if len(own) > 1 and np.linalg.norm(net) > ONE_WAY * sum(one.force for one in own):
            found.append(list(own))
    return found


def shifted_load(pushes: Sequence[Push], motions: Sequence[FloatArray], held: Sequence[float]) -> dict[int, float]:
    """Newtons that each board bears more, by number of the contact. motions: of the boards as the object sees them,
    f64[4, 4] each. held: newtons a metre with which the object is held across the push, as each board is told.

    The object follows the boards along their pushes, as far as those say where it is; the rest of it is held back.
    """
    directions = np.array([one.direction for one in pushes])
    net = np.array([one.force for one in pushes]) @ directions
    way = net / np.linalg.norm(net)
    moved = np.array(
        [motion[:3, :3] @ one.place + motion[:3, 3] - one.place for one, motion in zip(pushes, motions, strict=True)]
    )
    back = np.linalg.pinv(directions) @ (np.asarray(held) * (directions * moved).sum(axis=1))
    back -= way * (way @ back)
    more = np.linalg.pinv(directions.T) @ back
    return {one.number: max(float(add), (LEAST_SHARE - 1.0) * one.force) for one, add in zip(pushes, more, strict=True)}
