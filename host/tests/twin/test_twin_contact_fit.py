"""Estimates of the poses of a contact from its signals, and the prediction at these poses."""

import numpy as np
import pytest

from host.tests.twin.simulated_rig import BOARD, HAND, make_poses, make_simulator, move_object
from taxel.twin.simulated.contact_fit import OBJECT_PRIOR
from taxel.twin.simulated.predicted_contacts import is_plausible
from taxel.twin.simulated.robust_fit import Prior, fit


@pytest.fixture(scope="module")
def simulator():
    """The simulator of the rig."""
    return make_simulator()


@pytest.fixture(scope="module")
def measured(simulator):
    """Signals of a contact without noise, f64[n]."""
    signal = simulator.predict(make_poses())
    assert (signal > 150.0).sum() > 6
    return signal


def compute_relative_error(predicted, measured):
    """Return the RMS of the difference relative to the RMS of the measured signals."""
    return np.linalg.norm(predicted - measured) / np.linalg.norm(measured)


@pytest.mark.parametrize(
    ("translation_m", "turn_rad"), [((0.002, -0.001, 0.0005), 0.05), ((-0.003, 0.002, 0.002), -0.06)]
)
def test_the_estimate_finds_the_contact_from_nominal_poses_that_are_millimetres_wrong(
    simulator, measured, translation_m, turn_rad
):
    nominal = move_object(make_poses(), translation_m, turn_rad)
    assert compute_relative_error(simulator.predict(nominal), measured) > 0.3
    estimate = simulator.estimate(nominal, measured)
    assert compute_relative_error(estimate.signal, measured) < 0.08
    assert is_plausible(estimate, np.zeros_like(estimate.motion), measured)


def test_the_estimate_at_exact_poses_predicts_the_signals(simulator, measured):
    estimate = simulator.estimate(make_poses(), measured)
    assert compute_relative_error(estimate.signal, measured) < 1e-3
    assert np.abs(estimate.motion[:6] / OBJECT_PRIOR).max() < 0.05


def test_a_dead_line_does_not_move_the_object(simulator, measured):
    line = (HAND.board_index == HAND.boards.index(BOARD)) & (HAND.tx == HAND.tx[np.argmax(measured)])
    dead = np.where(line, 0.0, measured)
    assert (measured[line] > 150.0).sum() > 1
    estimate = simulator.estimate(make_poses(), dead)
    assert compute_relative_error(estimate.signal, measured) < 0.15  # the healthy signals are predicted


def test_missing_taxels_are_predicted_from_the_others(simulator, measured):
    missing = np.argmax(measured)
    partial = measured.copy()
    partial[missing] = np.nan
    estimate = simulator.estimate(move_object(make_poses(), (0.001, 0.0, 0.0), 0.0), partial)
    assert estimate.signal[missing] == pytest.approx(measured[missing], rel=0.1)


def test_an_object_pose_that_jumps_is_implausible(simulator, measured):
    estimate = simulator.estimate(move_object(make_poses(), (0.0, 0.0, 0.1), 0.0), measured)
    assert not is_plausible(estimate, np.zeros_like(estimate.motion), measured)


def test_a_frame_follows_the_frame_before(simulator, measured):
    first = simulator.estimate(make_poses(), measured)
    lighter = simulator.predict(make_poses(depth_m=0.0006))
    followed = simulator.follow(make_poses(), lighter, np.zeros_like(first.motion), first.motion, 3)
    assert compute_relative_error(followed.signal, lighter) < 0.05


class Line:
    """A straight line through points of which one is wrong: parameters are offset and slope."""

    x = np.linspace(-1.0, 1.0, 21)

    def __init__(self, y):
        self.y = y

    def compute_errors(self, parameters):
        """Return the errors at the points, in units of 0.01."""
        return (self.y - parameters[0] - parameters[1] * self.x) / 0.01

    def differentiate(self, parameters, errors):
        """Return minus the derivatives of the errors."""
        return np.stack([np.ones_like(self.x), self.x], axis=1) / 0.01


def test_one_wrong_value_hardly_changes_a_robust_fit():
    y = 0.3 + 0.5 * Line.x
    y[3] += 10.0
    prior = Prior(np.zeros(2), np.ones(2))
    found, _ = fit(Line(y), prior, np.zeros(2), 50)
    assert found == pytest.approx([0.3, 0.5], abs=2e-3)
    gaussian, _ = fit(Line(y), prior, np.zeros(2), 50, degrees=1e9)
    assert abs(gaussian[0] - 0.3) > 0.2
