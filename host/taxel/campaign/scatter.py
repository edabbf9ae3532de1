"""What nobody commands: where the object stands, how hard the hand grips, how the skin is mounted.

The emulated hand draws it. The simulator, which knows its size from repeats, goes through it in a balanced design:
effects of first order vanish from the mean of a few repeats, and those of second order come out as in many draws.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import hadamard

from taxel.hand.transforms import from_rotation_vector

_GRASP_STREAM = 2  # of a seed; 1 is that of the brackets (session.py)

FACTORS = 7
"""Where the object stands (3), how it is turned (3), and the grip."""


@dataclass(frozen=True)
class Scatter:
    """Standard deviations of what nobody commands. All zero: every repeat is the same.

    object_m, object_rad: where the object stands, each grasp, each axis. grip: relative, of the torque, each grasp.
    remount_m, remount_rad: of every bracket, each session, each axis. objects: names of those that stand better or
    worse than the others, and the factor on object_m and object_rad.
    """

    object_m: float = 0.7e-3
    object_rad: float = 0.01
    grip: float = 0.05
    remount_m: float = 0.15e-3
    remount_rad: float = 0.004
    objects: tuple[tuple[str, float], ...] = ()

    def of(self, item: str) -> Scatter:
        """As it is with one object."""
        factor = dict(self.objects).get(item, 1.0)
        return replace(self, object_m=factor * self.object_m, object_rad=factor * self.object_rad, objects=())

    def moved(self, draw: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """Where the object is in its nominal frame, f64[4, 4], and the factor on the torque, of f64[7] unit draws."""
        return shift(draw[:3], draw[3:6], self.object_m, self.object_rad), max(1.0 + self.grip * float(draw[6]), 0.0)


STILL: Final = Scatter(object_m=0.0, object_rad=0.0, grip=0.0, remount_m=0.0, remount_rad=0.0)
"""Everything is where it is believed to be."""


def shift(place: NDArray[np.float64], turn: NDArray[np.float64], metres: float, radians: float) -> NDArray[np.float64]:
    """A small motion of unit draws f64[3] and f64[3], f64[4, 4]."""
    motion = from_rotation_vector(radians * turn)
    motion[:3, 3] = metres * place
    return motion


def hand_draw(seed: int, grasp: str) -> NDArray[np.float64]:
    """What the emulated hand of a campaign draws for a grasp: f64[7], normal."""
    return np.random.default_rng([seed, _GRASP_STREAM, *grasp.encode()]).normal(size=FACTORS)


def balanced_draw(seed: int, name: str, repeat: int) -> NDArray[np.float64]:
    """Repeat number `repeat` of the grasp `name`: each of its 7 factors one standard deviation up or down.

    Repeats 2 k and 2 k + 1 are opposite, so that they cancel in first order; 16 repeats are a two-level design in which
    no factor is mixed with another (Hadamard's matrix of order 8, folded over). `seed` and `name` decide the signs.
    """
    signs = np.random.default_rng([seed, zlib.crc32(name.encode())]).choice([-1.0, 1.0], FACTORS)
    row = hadamard(8)[(repeat // 2) % 8, 1:]
    return np.asarray((1.0 - 2.0 * (repeat % 2)) * signs * row)
