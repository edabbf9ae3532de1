"""A calibrated flat board and synthetic approaches, whose response is an exponential function of the gap."""

from collections.abc import Callable

import numpy as np
import pytest

from taxel.hand import Board, Hand, load_hand
from taxel.proximity import KindCalibration, TargetResponse
from taxel.proximity.response import ResponseCurve
from taxel.proximity.skin_points import compute_skin_points

RATE_HZ = 20.0
NOISE = 4.0
DISTANCES = np.array([0.3, 0.6, 1.0, 1.5, 2.0, 2.7, 3.5, 4.5, 6.0, 8.0, 10.5, 14.0]) * 1e-3


def respond(gap_m: np.ndarray) -> np.ndarray:
    """Return the signal of a taxel below a grounded target, counts: the law of the response in these tests."""
    return -300.0 * np.exp(-gap_m / 0.003)


@pytest.fixture
def hand() -> Hand:
    return load_hand("original")


@pytest.fixture
def board(hand: Hand) -> Board:
    return hand.find_board("medial_front_index")


@pytest.fixture
def calibration() -> KindCalibration:
    curve = ResponseCurve(DISTANCES, respond(DISTANCES), 4.0)
    other = ResponseCurve(DISTANCES, 40.0 * np.exp(-DISTANCES / 0.0015), 4.0)
    targets = {
        "grounded": TargetResponse(curve, 0.02, 0.03, ("medial_front_index",)),
        "acrylic": TargetResponse(other, 0.02, 0.03, ("medial_front_index",)),
    }
    return KindCalibration(NOISE, 0.3, targets)


@pytest.fixture
def make_frames(hand: Hand, board: Board) -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """Return a function that makes the frames of a board in front of a moving target.

    Its arguments: distance_m: distance of the target at given times. law: signal at given gaps, counts. drift: decrease
    of all counts, counts per second. It returns times f64[T], seconds, and raw counts f64[T, n] with noise.
    """

    def make(
        distance_m: Callable[[np.ndarray], np.ndarray],
        seconds: float,
        seed: int = 1,
        drift: float = 0.0,
        law: Callable[[np.ndarray], np.ndarray] = respond,
    ) -> tuple[np.ndarray, np.ndarray]:
        rng = np.random.default_rng(seed)
        points = compute_skin_points(hand, board)
        axis = points.normal[points.n_taxels // 2]
        height = points.position @ axis
        cosine = np.maximum(points.direction @ axis, 0.05)  # taxels that do not face the target get large gaps
        times = np.arange(0.0, seconds, 1.0 / RATE_HZ)
        gaps = (height.max() - height + distance_m(times)[:, None, None]) / cosine
        signal = law(gaps).mean(axis=2) + drift * times[:, None]
        return times, np.round(3000.0 - signal + NOISE * rng.normal(size=signal.shape))

    return make
