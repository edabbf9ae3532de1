"""Injected causes that couple taxels: spread of pressure and crosstalk of electrodes."""

from __future__ import annotations

import numpy as np

from taxel.blind.injection.building_blocks import spread
from taxel.blind.injection.skin_counts import GraspSignal, Injection, SkinTable
from taxel.types import FloatArray


def sample_gaussian_spread(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a spread with a Gaussian kernel; in half of the cases, the total signal is kept."""
    reach = rng.uniform(0.004, 0.009)
    return spread(np.exp(-((skin.distance / reach) ** 2)), bool(rng.integers(2)))


def sample_lorentzian_spread(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a spread that decreases with the third power of the distance; in half of the cases, the total is kept."""
    reach = rng.uniform(0.003, 0.007)
    return spread(1.0 / (1.0 + (skin.distance / reach) ** 3), bool(rng.integers(2)))


def sample_ladder(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a coupling along lines that decreases exponentially with the number of crossings between two taxels."""
    mix = np.zeros((skin.n, skin.n))
    for axis, index in (("tx", skin.rx), ("rx", skin.tx)):
        steps = np.abs(index[:, None] - index)
        mix += rng.uniform(0.1, 1.0) * skin.shares_line(axis) * np.exp(-steps / rng.uniform(1.5, 4.0))
    return lambda grasp, strength: grasp.signal + 0.3 * strength * (grasp.signal @ mix)


def sample_root_sum(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a crosstalk that adds the root of the sum of squared signals over the other taxels of a line.

    The lines are TX lines, RX lines or both.
    """
    axes = [("tx",), ("rx",), ("tx", "rx")][int(rng.integers(3))]
    lines = [skin.shares_line(axis).astype(np.float64) for axis in axes]

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Add 15 % of the root sum of squares over the line at strength 1, for each axis."""
        squares = np.maximum(grasp.signal, 0.0) ** 2
        return np.asarray(grasp.signal + 0.15 * strength * np.sum([np.sqrt(squares @ line) for line in lines], axis=0))

    return inject
