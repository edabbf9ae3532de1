"""Indentation by a round probe, as forces on taxels over time; a stimulus for the emulated skin."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.hand.description import Hand

RISE_S = 0.25
"""Duration of the loading ramp and of the unloading ramp, seconds."""

SAMPLE_S = 0.01
"""Time between two samples of a stimulus, seconds; the emulator interpolates linearly."""


@dataclass(frozen=True)
class Indentation:
    """Indentation of one board by a round probe.

    `tx`, `rx`: position in rows and columns of the unrolled sheet, which are the TX and RX lines of a board without a
    described layout (fractions allowed; one row or column is one pitch). `force_n`: total force, newtons.
    `start_s`: start of the loading ramp. `hold_s`: duration of the full force. `diameter_m`: of the probe.
    """

    board: str
    tx: float
    rx: float
    force_n: float
    start_s: float
    hold_s: float = 0.6
    diameter_m: float = 0.012

    @property
    def end_s(self) -> float:
        """End of the unloading ramp, seconds."""
        return self.start_s + 2.0 * RISE_S + self.hold_s


def compute_force_shares(hand: Hand, indentation: Indentation) -> NDArray[np.float64]:
    """Compute the fraction of the probe's force on each taxel of the hand, f64[n].

    The pressure follows Hertz's solution for a sphere, p ~ sqrt(1 - (r / a)^2). The fractions add to 1; all are 0 if
    the probe covers no taxel centre. Every row and column is assumed to be one pitch wide. On a board whose described
    layout has another pitch, the true distances between taxels differ from the assumed ones by up to a factor of 2.
    """
    board = hand.find_board(indentation.board)
    distance = hand.pitch_m * np.hypot(
        board.kind.row - float(indentation.tx), board.kind.column - float(indentation.rx)
    )
    pressure_squared = 1.0 - (distance / (0.5 * indentation.diameter_m)) ** 2
    pressure = np.sqrt(np.maximum(pressure_squared, 0.0))
    share = np.zeros(hand.n_taxels)
    if pressure.sum() > 0.0:
        share[hand.get_slice(board.address)] = pressure / pressure.sum()
    return share


def compute_force(indentation: Indentation, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the force of the probe at `times_s` [T], newtons, f64[T]: loading ramp, hold, unloading ramp."""
    corners = indentation.start_s + np.array(
        [0.0, RISE_S, RISE_S + indentation.hold_s, 2.0 * RISE_S + indentation.hold_s]
    )
    return np.interp(times_s, corners, [0.0, indentation.force_n, indentation.force_n, 0.0], left=0.0, right=0.0)


def compute_indentation_forces(
    hand: Hand, indentations: Sequence[Indentation]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute (times [T] in seconds, forces [T, n] in newtons) of several indentations, for `write_stimulus`."""
    end = max((indentation.end_s for indentation in indentations), default=0.0)
    begin = min((indentation.start_s for indentation in indentations), default=0.0)
    times = np.concatenate([[0.0], np.arange(begin, end + 2.0 * SAMPLE_S, SAMPLE_S)])
    forces = np.zeros((len(times), hand.n_taxels))
    for indentation in indentations:
        forces += np.outer(compute_force(indentation, times), compute_force_shares(hand, indentation))
    return times, forces
