"""Injected causes that act over time: noise, drift, hysteresis, latency."""

from __future__ import annotations

import numpy as np

from taxel.blind.injection.building_blocks import delay, low_pass
from taxel.blind.injection.skin_counts import GraspSignal, Injection, SkinTable
from taxel.types import FloatArray


def sample_heavy_noise(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample white noise with a Student t distribution of three degrees of freedom."""
    scale = 40.0 * rng.uniform(0.5, 1.5, skin.n)
    return lambda grasp, strength: grasp.signal + strength * scale * grasp.rng.standard_t(3.0, grasp.signal.shape)


def sample_bursts(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample bursts: in random frames, all taxels of a TX line get the same random offset.

    rate: share of frames with a burst. counts: standard deviation of the offset at strength 1.
    """
    line = skin.sensor * 256 + skin.tx
    number = np.unique(line, return_inverse=True)[1]
    rate, counts = rng.uniform(0.1, 0.4), 120.0

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Add the bursts. number: index of the TX line of each taxel."""
        frames = len(grasp.signal)
        active = grasp.rng.random((frames, int(number.max()) + 1)) < rate
        burst = np.where(active, grasp.rng.normal(0.0, strength * counts, active.shape), 0.0)
        return np.asarray(grasp.signal + burst[:, number])

    return inject


def sample_ramp(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a drift that is linear in time, with a different rate for each board: 3 to 10 counts/s at strength 1."""
    rate = np.zeros(skin.n)
    for board in skin.boards:
        rate[board] = rng.uniform(0.3, 1.0)
    rate *= rng.choice([-1.0, 1.0])
    return lambda grasp, strength: grasp.signal + 10.0 * strength * rate * (grasp.time_s - grasp.time_s[0])[:, None]


def sample_walk(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a drift that is a random walk in time, independent for each board.

    Its standard deviation after 1 s is 30 counts at strength 1.
    """
    number = np.unique(skin.sensor, return_inverse=True)[1]

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Add the random walk of its board to each taxel."""
        step = np.sqrt(np.maximum(np.diff(grasp.time_s, prepend=grasp.time_s[0]), 0.0))
        walk = np.cumsum(step[:, None] * grasp.rng.normal(0.0, 30.0, (len(step), int(number.max()) + 1)), axis=0)
        return np.asarray(grasp.signal + strength * walk[:, number])

    return inject


def sample_backlash(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a backlash: the output changes only while the signal differs from the output by more than a width.

    share: width for a rising signal at strength 1, as a share of the taxel's maximum signal. The width for a falling
    signal is 0.3 times as large.
    """
    share = rng.uniform(0.15, 0.35)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Apply the backlash of `width` counts; taxels with a maximum signal below 30 counts are not changed."""
        width = min(share * strength, 0.9) * np.maximum(grasp.signal.max(axis=0), 0.0)
        result = np.empty_like(grasp.signal)
        state = np.zeros(grasp.signal.shape[1])
        for frame, value in enumerate(grasp.signal):
            state = np.clip(state, value - width, value + 0.3 * width)
            result[frame] = np.where(width > 30.0 * share * strength, state, value)
        return result

    return inject


def sample_creep(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a creep with three time constants: a share of the signal follows late, and remains after the release.

    seconds: the time constants. weight: their random weights, with the sum 1.
    """
    seconds, weight = np.array([0.15, 1.0, 7.0]), rng.dirichlet(np.ones(3))

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Replace half of the signal at strength 1 by the weighted sum of its low-pass filtered versions."""
        period = float(np.median(np.diff(grasp.time_s)))
        late = sum(
            part * low_pass(grasp.signal, 1.0 - np.exp(-period / constant))
            for part, constant in zip(weight, seconds, strict=True)
        )
        share = min(0.5 * strength, 0.95)
        return np.asarray((1.0 - share) * grasp.signal + share * late)

    return inject


def sample_jitter(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a delay of one or two boards that differs from grasp to grasp: 0.1 to 0.3 s at strength 1."""
    chosen = rng.permutation(len(skin.boards))[: int(rng.integers(1, 3))]

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Delay the chosen boards, each by a random time of this grasp."""
        result = grasp.signal.copy()
        for index in chosen:
            delay_s, board = strength * grasp.rng.uniform(0.1, 0.3), skin.boards[index]
            result[:, board] = delay(grasp.signal[:, board], grasp.time_s, delay_s)
        return result

    return inject


def sample_two_poles(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a second-order low-pass filter on one or two boards: two equal time constants, 0.12 s at strength 1."""
    chosen = rng.permutation(len(skin.boards))[: int(rng.integers(1, 3))]

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Apply the first-order filter twice to the chosen boards. share: share of a step that passes in one frame."""
        period = float(np.median(np.diff(grasp.time_s)))
        share = 1.0 - np.exp(-period / max(0.12 * strength, 1e-6))
        result = grasp.signal.copy()
        for index in chosen:
            board = skin.boards[index]
            result[:, board] = low_pass(low_pass(grasp.signal[:, board], share), share)
        return result

    return inject
