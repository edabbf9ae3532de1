"""Variation between repeats: pose of the object, strength of the grip, mounting of the skin.

The emulated hand samples the variation randomly. The simulator uses a balanced two-level design, in which every
quantity deviates by plus or minus one standard deviation: first-order effects cancel in the mean of a few repeats, and
second-order effects have the same expectation as with random samples.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import hadamard

from taxel.hand.transforms import from_rotation_vector

_GRASP_STREAM = 2  # random stream of the grasps; stream 1 is that of the brackets (session.py)
_REPEAT_STREAM = 4  # of the repeated attempts; stream 3 is that of the simulated noise (simulated.py)

FACTORS = 7
"""Number of varied quantities per grasp: position of the object (3), rotation of the object (3), grip (1)."""


@dataclass(frozen=True)
class Variation:
    """Standard deviations of the quantities that the plan does not control. All zero: all repeats are identical.

    object_m, object_rad: position and rotation of the object, per grasp and axis. grip: finger torque, relative, per
    grasp. remount_m, remount_rad: position and rotation of every bracket, per session and axis. objects: pairs of an
    object's name and a factor on object_m and object_rad, for objects that stand more or less firmly than the others.
    """

    object_m: float = 0.7e-3
    object_rad: float = 0.01
    grip: float = 0.05
    remount_m: float = 0.15e-3
    remount_rad: float = 0.004
    objects: tuple[tuple[str, float], ...] = ()

    def for_object(self, name: str) -> Variation:
        """Return the variation for grasps of the object `name`, with the factor of this object applied."""
        factor = dict(self.objects).get(name, 1.0)
        return replace(self, object_m=factor * self.object_m, object_rad=factor * self.object_rad, objects=())

    def apply(self, sample: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """Scale unit samples f64[7] to a displacement of the object, f64[4, 4], and a factor on the finger torques.

        The displacement is in the nominal frame of the object: true pose = nominal pose @ displacement.
        """
        offset = make_small_motion(sample[:3], sample[3:6], self.object_m, self.object_rad)
        return offset, max(1.0 + self.grip * float(sample[6]), 0.0)


NO_VARIATION: Final = Variation(object_m=0.0, object_rad=0.0, grip=0.0, remount_m=0.0, remount_rad=0.0)
"""Every object and bracket is at its nominal pose, and every grip has its nominal strength."""


def make_small_motion(
    translation: NDArray[np.float64], rotation: NDArray[np.float64], metres: float, radians: float
) -> NDArray[np.float64]:
    """Make a small motion f64[4, 4] from unit samples of the translation f64[3] and of the rotation vector f64[3].

    metres, radians: factors on the samples of translation and rotation.
    """
    motion = from_rotation_vector(radians * rotation)
    motion[:3, 3] = metres * translation
    return motion


def sample_grasp_variation(seed: int, grasp: str, attempt: int = 0) -> NDArray[np.float64]:
    """Sample the variation of one grasp on the emulated hand: seven normal samples with standard deviation 1, f64[7].

    grasp: id of the grasp. attempt: number of earlier, failed attempts.
    """
    stream = [_GRASP_STREAM] if attempt == 0 else [_REPEAT_STREAM, attempt]
    return np.random.default_rng([seed, *stream, *grasp.encode()]).normal(size=FACTORS)


def sample_balanced_variation(seed: int, name: str, repeat: int, attempt: int = 0) -> NDArray[np.float64]:
    """Compute the variation of a simulated grasp by a balanced design: seven factors, each -1 or +1, f64[7].

    repeat: number of the repeat, from 0. The factors of the repeats 2 k and 2 k + 1 have opposite signs and cancel in
    first order. 16 repeats form a two-level design in which no two factors are confounded (Hadamard matrix of order 8,
    folded over). `seed` and the grasp's `name` determine the signs. attempt: number of earlier, failed attempts; if it
    is above 0, all signs are random.
    """
    if attempt > 0:
        stream = [seed, _REPEAT_STREAM, attempt, repeat, zlib.crc32(name.encode())]
        return np.random.default_rng(stream).choice([-1.0, 1.0], FACTORS)
    signs = np.random.default_rng([seed, zlib.crc32(name.encode())]).choice([-1.0, 1.0], FACTORS)
    row = hadamard(8)[(repeat // 2) % 8, 1:]
    return np.asarray((1.0 - 2.0 * (repeat % 2)) * signs * row)
