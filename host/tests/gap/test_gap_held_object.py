"""An object between two boards at an angle, held elsewhere: who bears more, and by how much."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.effects.held_object import LEAST_SHARE, Push, pushes_together, shifted_load

SLOPE = np.sqrt(0.5)
LEFT = Push(0, 5.0, np.array([SLOPE, 0.0, SLOPE]), np.array([-0.01, 0.0, 0.0]))
RIGHT = Push(3, 5.0, np.array([-SLOPE, 0.0, SLOPE]), np.array([0.01, 0.0, 0.0]))


def seen(x_m: float, z_m: float = 0.0) -> np.ndarray:
    """A board's motion as an object sees it that has itself moved by so much."""
    motion = np.eye(4)
    motion[:3, 3] = -x_m, 0.0, -z_m
    return motion


def test_a_corner_pushes_back_what_is_held_aside():
    held = 3000.0
    more = shifted_load([LEFT, RIGHT], [seen(0.001)] * 2, [held] * 2)
    # Towards the right: the right board pushes it to the left by what the hold bears.
    assert more[3] > 0 > more[0]
    across = SLOPE * (5.0 + more[0]) - SLOPE * (5.0 + more[3])
    assert across == pytest.approx(-held * 0.001)
    assert more[0] + more[3] == pytest.approx(0.0, abs=1e-12)  # the push along its way is what it was


def test_what_is_displaced_along_the_push_is_approached_anew():
    more = shifted_load([LEFT, RIGHT], [seen(0.0, 0.002)] * 2, [3000.0] * 2)
    assert more == pytest.approx({0: 0.0, 3: 0.0}, abs=1e-12)


def test_what_is_not_held_shares_as_before():
    assert shifted_load([LEFT, RIGHT], [seen(0.001)] * 2, [0.0] * 2) == pytest.approx({0: 0.0, 3: 0.0})


def test_no_board_pulls():
    more = shifted_load([LEFT, RIGHT], [seen(0.02)] * 2, [3000.0] * 2)
    assert more[0] == pytest.approx((LEAST_SHARE - 1.0) * 5.0)


def test_only_boards_that_push_one_way_share_an_object():
    against = Push(7, 5.0, -LEFT.direction, np.zeros(3))
    assert pushes_together({0: [LEFT], 1: [LEFT, RIGHT], 2: [LEFT, against]}) == [[LEFT, RIGHT]]
