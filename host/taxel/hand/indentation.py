"""Presses with a round probe, as forces on taxels over time: something for the emulated skin to feel."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.hand.description import Hand

RISE_S = 0.25
"""Seconds in which a press reaches its full force, and in which it is let go."""

SAMPLE_S = 0.01
"""Time between two records of a stimulus; the emulator draws straight lines between them."""


@dataclass(frozen=True)
class Indentation:
    """A round probe pressed onto one board.

    `tx`, `rx`: where, in electrode lines (fractions allowed; one line is one pitch). `force_n`: the probe's whole
    force, newtons. `start_s`, `hold_s`: seconds. `diameter_m`: of the probe.
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
        """When the probe has left the skin."""
        return self.start_s + 2.0 * RISE_S + self.hold_s


def compute_force_shares(hand: Hand, press: Indentation) -> NDArray[np.float64]:
    """Share [n] of the probe's force that each taxel of the hand carries.

    Pressure falls from the middle of the contact as in Hertz's solution for a sphere, p ~ sqrt(1 - (r / a)^2). Shares
    add to 1; if the probe misses every taxel, all are 0.
    """
    board = hand.find_board(press.board)
    distance = hand.pitch_m * np.hypot(board.kind.tx - float(press.tx), board.kind.rx - float(press.rx))
    inside = 1.0 - (distance / (0.5 * press.diameter_m)) ** 2
    pressure = np.sqrt(np.maximum(inside, 0.0))
    share = np.zeros(hand.n_taxels)
    if pressure.sum() > 0.0:
        share[hand.get_slice(board.address)] = pressure / pressure.sum()
    return share


def force_at(press: Indentation, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """The probe's force [T] in newtons at `times_s` [T]: a ramp up, a hold, a ramp down."""
    corners = press.start_s + np.array([0.0, RISE_S, RISE_S + press.hold_s, 2.0 * RISE_S + press.hold_s])
    return np.interp(times_s, corners, [0.0, press.force_n, press.force_n, 0.0], left=0.0, right=0.0)


def compute_indentation_forces(
    hand: Hand, presses: Sequence[Indentation]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(times [T] in seconds, forces [T, n] in newtons) of all presses together, for `taxel.link.write_stimulus`."""
    end = max((press.end_s for press in presses), default=0.0)
    begin = min((press.start_s for press in presses), default=0.0)
    times = np.concatenate([[0.0], np.arange(begin, end + 2.0 * SAMPLE_S, SAMPLE_S)])
    forces = np.zeros((len(times), hand.n_taxels))
    for press in presses:
        forces += np.outer(force_at(press, times), compute_force_shares(hand, press))
    return times, forces
