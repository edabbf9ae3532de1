"""Transitions and probabilities of the motion filter."""

import numpy as np
import pytest

from taxel.proximity.motion_filter import MotionFilter
from taxel.proximity.motion_grid import CENTRES_M, SPEEDS_M_S, get_transition


@pytest.mark.parametrize("dt_s", [0.002, 0.054, 0.5, 20.0])
def test_prediction_conserves_the_total_probability_and_keeps_all_probabilities_positive(dt_s):
    state = MotionFilter(np.array([1.0, 2.0, 1.0]))  # prior weights of three templates
    for _ in range(50):
        state.predict(get_transition(dt_s))
        total = float(state.present.sum()) + state.far + state.contact
        assert abs(total - 1.0) < 1e-3
        assert state.far >= 0.0
        assert state.contact >= 0.0


def test_mean_distance_decreases_by_speed_times_interval():
    transition = get_transition(0.05)
    speed, column = int(np.argmin(np.abs(SPEEDS_M_S - 0.04))), int(np.argmin(np.abs(CENTRES_M - 5e-3)))
    mean = float(transition.shift[speed, column] @ CENTRES_M)
    assert mean == pytest.approx(CENTRES_M[column] - SPEEDS_M_S[speed] * 0.05, abs=3e-4)


def test_left_out_template_returns_instead_of_a_contact_when_it_fits():
    """The filter discards improbable templates (shapes and kinds of targets).

    The arguments of `update` are log likelihoods: of a target by template and distance, of no target, and of a contact.
    """
    state = MotionFilter(np.ones(3))
    likelihood = np.zeros((3, len(CENTRES_M)))
    likelihood[1:] = -12.0  # only the first template fits
    for _ in range(100):
        state.predict(get_transition(0.05))
        state.update(likelihood, -30.0, -30.0)
    assert state.template.tolist() == [0]
    for _ in range(5):  # now only the last template fits
        state.predict(get_transition(0.05))
        state.update(likelihood[::-1] - 1.0, -30.0, -20.0)
    assert state.template[np.argmax(state.present.sum(axis=(0, 2)))] == 2
    assert state.contact < 0.2


def test_frame_that_no_state_explains_restarts_the_filter_without_a_target():
    state = MotionFilter(np.ones(3))
    state.predict(get_transition(0.05))
    state.update(np.full((3, len(CENTRES_M)), -np.inf), -np.inf, -1e6)
    assert (state.far, state.contact, float(state.present.sum())) == (1.0, 0.0, 0.0)
