"""Injected causes that change the signal of single taxels: gain, stiffness, saturation, proximity, dropout."""

from __future__ import annotations

import numpy as np

from taxel.blind.injection.building_blocks import choose_boards, kill
from taxel.blind.injection.skin_counts import GraspSignal, Injection, SkinTable
from taxel.types import FloatArray


def sample_gradient(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a gain whose logarithm changes linearly across one or two boards, from one edge to the opposite one.

    At strength 1 the logarithm changes by 1 from edge to edge.
    """
    slope = np.zeros(skin.n)
    for board in choose_boards(skin, rng, 2):
        place = skin.position[board] @ rng.normal(size=3)
        slope[board] = 2.0 * (place - place.min()) / max(np.ptp(place), 1e-9) - rng.uniform(0.0, 1.0)
    return lambda grasp, strength: grasp.signal * np.exp(0.5 * strength * slope)


def sample_uniform_gain(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample an independent, uniformly distributed gain for each taxel."""
    deviation = rng.uniform(-0.6, 0.6, skin.n)
    return lambda grasp, strength: grasp.signal * np.maximum(1.0 + strength * deviation, 0.1)


def sample_power_law(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a layer with another stiffness whose compression follows a power of the force."""
    sign, power = rng.choice([-1.0, 1.0]), rng.uniform(0.9, 1.1)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Convert the signal to a relative force, change the force as a softer or harder layer does, convert back."""
        # The inverse of signal = full scale * force / (1 + force) gives a relative force; the clip keeps it finite.
        share = np.clip(grasp.signal / skin.full_scale, 0.0, 0.98)
        force = share / (1.0 - share) * np.exp(sign * 0.6 * strength)  # by a factor of 1.8 at strength 1
        softer = force ** (1.0 + (power - 1.0) * min(strength, 2.0))
        return np.where(grasp.signal > 0.0, skin.full_scale * softer / (1.0 + softer), grasp.signal)

    return inject


def sample_tanh(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a saturation by a hyperbolic tangent. The largest signal at strength 1 is `limit` counts."""
    limit = rng.uniform(1000.0, 2500.0)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Limit the signal to `limit` / `strength` counts."""
        cap = limit / max(strength, 1e-3)
        return np.asarray(cap * np.tanh(grasp.signal / cap))

    return inject


def sample_logarithm(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a saturation by a logarithm, which begins at signals of about `limit` counts at strength 1."""
    limit = rng.uniform(1500.0, 4000.0)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Compress signals above about `limit` / `strength` counts logarithmically."""
        cap = limit / max(strength, 1e-3)
        return np.asarray(np.sign(grasp.signal) * cap * np.log1p(np.abs(grasp.signal) / cap))

    return inject


def sample_near_field(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a response to an object that is near but does not touch, with a Gaussian dependence on the separation.

    reach: length of the Gaussian, metres. counts: response at separation 0 and strength 1.
    """
    reach, counts = rng.uniform(0.001, 0.004), 400.0

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Add the response to the separation f64[T, n] (metres); it vanishes as the signal approaches full scale."""
        if grasp.separation is None:
            return grasp.signal
        gap = np.maximum(grasp.separation, 0.0)
        near = np.exp(-((gap / reach) ** 2)) * np.clip(1.0 - grasp.signal / skin.full_scale, 0.0, 1.0)
        return grasp.signal + strength * counts * near

    return inject


def sample_cracked_line(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a line that is broken in its middle: the taxels of one half have no signal."""
    (board,) = choose_boards(skin, rng, 1)
    along, index = (skin.tx, skin.rx) if rng.integers(2) else (skin.rx, skin.tx)
    line = rng.choice(np.unique(along[board]))
    places = board[along[board] == line]
    dead = places[index[places] >= np.median(index[places])]
    return kill(dead)


def sample_dead_strip(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a strip without signal at the edge of a board, for example next to a loose connector."""
    (board,) = choose_boards(skin, rng, 1)
    place = skin.position[board] @ rng.normal(size=3)
    return kill(board[place <= np.quantile(place, rng.uniform(0.1, 0.35))])
