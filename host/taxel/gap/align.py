"""How the frames of two recordings fell: a common shift of all boards, within a frame, is no gap."""

from __future__ import annotations

import numpy as np

from taxel.gap.chain import Chain, Link
from taxel.gap.effects.effect import HAND
from taxel.gap.effects.latency import Latency
from taxel.gap.fit import fit, started
from taxel.gap.judge import Judge

ALIGNMENT = "alignment"

FRAMES = 1.5
"""Frame periods by which the first frames of a phase can lie apart in two recordings, at most."""


class Alignment(Latency):
    """The same as a latency, of the whole hand, and not an effect to be named."""

    name = ALIGNMENT
    order = 91


def aligned(judge: Judge, frame_s: float) -> Chain:
    """A chain of nothing but the shift: the median of the boards' delays, so that one late board does not move it.

    frame_s: frame period of the slower recording. Empty where the shift is nothing.
    """
    fitted = fit(judge.problem(), Chain((started(judge.state, Latency()),)), iterations=6).chain.links[0]
    touched = np.abs(judge.state.mean[:, : judge.layout.bins]).max(axis=(0, 1)) > 50.0
    boards = [
        board for board in range(fitted.values.shape[1]) if touched[judge.state.pair.groups.sensor == board].any()
    ]
    if not boards:
        return Chain()
    shift = float(np.clip(np.median(fitted.values[0, boards]), -FRAMES * frame_s, FRAMES * frame_s))
    return Chain((Link(Alignment(HAND), np.array([[shift]])),))
