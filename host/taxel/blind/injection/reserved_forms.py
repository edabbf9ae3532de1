"""Functional forms that are reserved for tests: no calibration and no development of the diagnosis has used them.

Each form samples its parameters for a skin and returns the injection. A strength of 1 is a typical case.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import fftconvolve

from taxel.blind.injection.building_blocks import choose_boards, delay, kill, low_pass, spread
from taxel.blind.injection.skin_counts import GraspSignal, Injection, SkinTable
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray


def sample_disc(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a spread that is even within a radius of 5 to 12 mm and 0 outside; in half of the cases, the total signal
    is kept.
    """
    kernel = (skin.distance < rng.uniform(0.005, 0.012)).astype(np.float64)
    return spread(kernel, bool(rng.integers(2)))


def sample_two_scales(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a spread with a near part of 2 mm and a far part of 10 to 20 mm; the total signal is kept."""
    near, far = np.exp(-skin.distance / 0.002), np.exp(-skin.distance / rng.uniform(0.01, 0.02))
    return spread(near / max(near.max(), 1e-12) + 0.2 * far / max(far.max(), 1e-12), keeps_total=True)


def sample_adjacent_lines(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a crosstalk between adjacent lines: a taxel gains 10 to 30 % of the signals of its two neighbours."""
    mix = np.zeros((skin.n, skin.n))
    for axis, index in (("tx", skin.rx), ("rx", skin.tx)):
        steps = np.abs(index[:, None] - index)
        mix += rng.uniform(0.1, 0.3) * (skin.shares_line(axis) & (steps == 1))
    return lambda grasp, strength: grasp.signal + strength * (grasp.signal @ mix)


def sample_limited_crosstalk(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a crosstalk along TX or RX lines that is limited to 100 to 300 counts at strength 1."""
    line = skin.shares_line(("tx", "rx")[int(rng.integers(2))]).astype(np.float64)
    limit = rng.uniform(100.0, 300.0)
    return lambda grasp, strength: (
        grasp.signal + strength * limit * np.tanh(0.2 * np.maximum(grasp.signal, 0.0) @ line / limit)
    )


def sample_slow_noise(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample noise of each taxel that is correlated over 2 to 5 frames, with a standard deviation of 40 counts."""
    share = 1.0 / rng.uniform(2.0, 5.0)
    # The filter reduces the variance of white noise to share / (2 - share).
    scale = 40.0 * np.sqrt((2.0 - share) / share)
    return lambda grasp, strength: (
        grasp.signal + strength * scale * low_pass(grasp.rng.normal(size=grasp.signal.shape), share)
    )


def sample_line_gains(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a gain for each TX line of each board; the logarithms have a standard deviation of 0.3 at strength 1."""
    lines, number = np.unique(256 * skin.sensor + skin.tx, return_inverse=True)
    log_gain = rng.normal(0.0, 0.3, len(lines))[number]
    return lambda grasp, strength: grasp.signal * np.exp(np.clip(strength * log_gain, -2.0, 2.0))


def sample_stiffening(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a layer whose stiffness differs under a large load and not under a small load, as after densification."""
    sign = rng.choice([-1.0, 1.0])

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Convert the signal to a relative force, change it by up to a factor of 1.8 at strength 1, convert back."""
        share = np.clip(grasp.signal / skin.full_scale, 0.0, 0.98)
        force = share / (1.0 - share)
        changed = force * np.exp(sign * 0.6 * strength * force / (force + 0.3))
        return np.where(grasp.signal > 0.0, skin.full_scale * changed / (1.0 + changed), grasp.signal)

    return inject


def sample_warm_up(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a drift that approaches its end value of 40 counts (strength 1) with a time constant of 1 to 4 s."""
    seconds, counts = rng.uniform(1.0, 4.0), 40.0 * rng.choice([-1.0, 1.0])
    return lambda grasp, strength: (
        grasp.signal + strength * counts * -np.expm1(-(grasp.time_s - grasp.time_s[0]) / seconds)[:, None]
    )


def sample_power_creep(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a creep whose late share follows 1 - exp(-(t / s)^0.5), with s of 0.5 to 3 s."""
    seconds = rng.uniform(0.5, 3.0)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Replace 40 % of the signal at strength 1 by its late version."""
        time = grasp.time_s - grasp.time_s[0]
        arrived = -np.expm1(-np.sqrt(time / seconds))
        steps = np.diff(grasp.signal, axis=0, prepend=grasp.signal[:1])
        late = grasp.signal[0] + fftconvolve(steps, arrived[:, None], axes=0)[: len(time)]
        share = min(0.4 * strength, 0.95)
        return np.asarray((1.0 - share) * grasp.signal + share * late)

    return inject


def sample_slow_unloading(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a layer that is late only while the signal decreases: time constant 0.4 to 1 s at strength 1."""
    seconds = rng.uniform(0.4, 1.0)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Follow a rising signal at once and a falling signal with the time constant."""
        period = float(np.median(np.diff(grasp.time_s)))
        share = -np.expm1(-period / max(seconds * strength, 1e-6))
        result, state = np.empty_like(grasp.signal), grasp.signal[0]
        for frame, value in enumerate(grasp.signal):
            state = np.where(value > state, value, state + share * (value - state))
            result[frame] = state
        return result

    return inject


def sample_arctangent(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a saturation by an arctangent. The largest signal at strength 1 is `limit` counts."""
    limit = rng.uniform(1200.0, 3000.0)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Limit the signal to `limit` / `strength` counts."""
        scale = 2.0 / np.pi * limit / max(strength, 1e-3)
        return np.asarray(scale * np.arctan(grasp.signal / scale))

    return inject


def sample_two_slopes(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a limit of 300 to 900 counts above which the signal increases more slowly."""
    limit = rng.uniform(300.0, 900.0)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Reduce the slope above the limit by 70 % at strength 1, and to 0 at larger strengths."""
        excess = np.maximum(np.abs(grasp.signal) - limit, 0.0)
        return np.asarray(grasp.signal - np.sign(grasp.signal) * min(0.7 * strength, 1.0) * excess)

    return inject


def sample_inverse_square(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a response to a near object that decreases with the square of 1 + separation / reach; 300 counts in
    contact at strength 1.
    """
    reach = rng.uniform(0.001, 0.003)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Add the response to the separation f64[T, n], metres, up to 30 mm."""
        if grasp.separation is None:
            return grasp.signal
        gap = np.maximum(grasp.separation, 0.0)
        return grasp.signal + strength * 300.0 * np.where(gap < 0.03, (1.0 + gap / reach) ** -2.0, 0.0)

    return inject


def sample_single_taxels(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample single taxels without signal: 10 to 30 % of the taxels of a board."""
    (board,) = choose_boards(skin, rng, 1)
    return kill(board[rng.random(len(board)) < rng.uniform(0.1, 0.3)])


def sample_slow_clock(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample one or two boards whose clock is slow: the delay increases linearly to 0.3 s (strength 1) in a grasp."""
    chosen = choose_boards(skin, rng, 2)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Delay each frame of the chosen boards by its share of the largest delay."""
        result, time = grasp.signal.copy(), grasp.time_s
        late = 0.3 * strength * (time - time[0]) / max(float(time[-1] - time[0]), 1e-9)
        for board in chosen:
            result[:, board] = delay(grasp.signal[:, board], time, late)
        return result

    return inject


def sample_ghost(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a ghost contact: each board shows a share of the signals of another board, 20 % at strength 1.

    A single board has no ghost.
    """
    order = rng.permutation(len(skin.boards))

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Add the signals of the other board in the order of its taxels; further taxels have no ghost."""
        result = grasp.signal.copy()
        for target, number in zip(order, np.roll(order, 1), strict=True):
            board, source = skin.boards[target], skin.boards[number]
            if target != number:
                common = min(len(board), len(source))
                result[:, board[:common]] += 0.2 * strength * grasp.signal[:, source[:common]]
        return result

    return inject


def sample_rebound(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a rebound: after the release, each taxel has a negative signal that decays with 0.3 to 1 s.

    At strength 1, the rebound begins with 20 % of the mean signal in hold.
    """
    seconds = rng.uniform(0.3, 1.0)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Subtract the decaying share of the signal in hold from the end of hold on."""
        after = np.flatnonzero(grasp.phase > Phase.HOLD)
        in_hold = grasp.phase == Phase.HOLD
        if not len(after) or not in_hold.any():
            return grasp.signal
        since = grasp.time_s[after] - grasp.time_s[after[0]]
        result = grasp.signal.copy()
        result[after] -= 0.2 * strength * np.exp(-since / seconds)[:, None] * grasp.signal[in_hold].mean(axis=0)
        return result

    return inject


def sample_wobble(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a gain that oscillates with 0.5 to 1.5 Hz, by 20 % at strength 1; the phase is 0 at the first frame."""
    hertz = rng.uniform(0.5, 1.5)
    return lambda grasp, strength: (
        grasp.signal * (1.0 + 0.2 * strength * np.sin(2.0 * np.pi * hertz * (grasp.time_s - grasp.time_s[0])))[:, None]
    )
