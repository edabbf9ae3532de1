"""Injected causes outside the catalogue of the diagnosis."""

from __future__ import annotations

import numpy as np

from taxel.blind.injection.skin_counts import GraspSignal, Injection, SkinTable
from taxel.types import FloatArray


def sample_dead_zone(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a dead zone: signals below a limit become 0, larger signals are reduced by this limit."""
    counts = rng.uniform(100.0, 250.0)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Apply the dead zone; its limit at strength 1 is `counts`."""
        limit = strength * counts
        return np.sign(grasp.signal) * np.maximum(np.abs(grasp.signal) - limit, 0.0)

    return inject


def sample_common_mode(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a host program that subtracts a share of a board's mean signal from the board's taxels."""

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Subtract `strength` times (at most 3 times) the mean signal of the board in each frame."""
        result = grasp.signal.copy()
        for board in skin.boards:
            result[:, board] -= min(strength, 3.0) * grasp.signal[:, board].mean(axis=1, keepdims=True)
        return result

    return inject


def sample_interference(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a sinusoidal interference with a random phase for each taxel, the same in every grasp.

    The frequency is 0.2 to 1 Hz, and the amplitude 60 counts at strength 1.
    """
    hertz, phase = rng.uniform(0.2, 1.0), rng.uniform(0.0, 2.0 * np.pi, skin.n)
    return lambda grasp, strength: (
        grasp.signal + 60.0 * strength * np.sin(2.0 * np.pi * hertz * (grasp.time_s - grasp.time_s[0])[:, None] + phase)
    )


def sample_automatic_gain(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample an automatic gain control: the larger the total signal of a board, the smaller its gain."""
    level = rng.uniform(4000.0, 12000.0)

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Reduce the gain of each board with its total signal: to 1/2 at a total of `level` counts and strength 1."""
        result = grasp.signal.copy()
        for board in skin.boards:
            total = np.maximum(grasp.signal[:, board], 0.0).sum(axis=1, keepdims=True)
            result[:, board] /= 1.0 + strength * total / level
        return result

    return inject


def sample_mirrored_board(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a board whose taxels are in reverse order; the strength is the share of the reversed signals."""
    board = skin.boards[int(rng.integers(len(skin.boards)))]

    def inject(grasp: GraspSignal, strength: float) -> FloatArray:
        """Mix the signals of the board with those in reverse order of its taxels."""
        share, result = min(strength, 1.0), grasp.signal.copy()
        result[:, board] = (1.0 - share) * grasp.signal[:, board] + share * grasp.signal[:, board[::-1]]
        return result

    return inject


def sample_sharpening(skin: SkinTable, rng: np.random.Generator) -> Injection:
    """Sample a sharpening filter, which subtracts a share of the neighbours' mean signal from each taxel.

    The share is 0.6 at strength 1. Neighbours are the taxels of a board within a random distance, 6 to 12 mm.
    """
    kernel = (skin.distance < rng.uniform(0.006, 0.012)).astype(np.float64)
    kernel /= np.maximum(kernel.sum(axis=0), 1.0)
    return lambda grasp, strength: grasp.signal - min(strength, 1.5) * 0.6 * (grasp.signal @ kernel)
