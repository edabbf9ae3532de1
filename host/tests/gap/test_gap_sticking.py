"""Hysteresis of a layer by sticking and by creep."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.effects.sticking import apply_creep, apply_play

TIME_S = np.linspace(0.0, 12.0, 1201)


def test_play_lets_the_output_lag_by_its_width_while_loading_and_hold_while_unloading():
    values = np.array([0.0, 1.0, 10.0, 20.0, 20.0, 19.0, 12.0, 0.0])[None, :, None]
    out = apply_play(values, np.full((1, 1), 4.0))[0, :, 0]
    assert out == pytest.approx([0.0, 0.0, 6.0, 16.0, 16.0, 16.0, 12.0, 0.0])


def test_play_is_independent_of_speed():
    slow = np.sin(np.linspace(0.0, np.pi, 101))[None, :, None]
    fast, width = slow[:, ::10], np.full((1, 1), 0.2)
    np.testing.assert_allclose(apply_play(slow, width)[:, ::10], apply_play(fast, width), atol=1e-12)


def test_creep_adds_the_same_share_in_every_decade_of_time():
    """With a creep of 0.1 per decade, the output is 1 at 0.1 s after the load (no creep), 1.1 at 1 s, 1.2 at 10 s."""
    step = np.where(TIME_S > 0.0, 1.0, 0.0)[None, :, None]
    out = apply_creep(step, TIME_S, np.array(0.1))[0, :, 0]
    at = {age: out[np.searchsorted(TIME_S, age)] for age in (0.1, 1.0, 10.0)}
    assert at[0.1] == pytest.approx(1.0, abs=0.02)
    assert at[10.0] - at[1.0] == pytest.approx(0.1, abs=0.01)
    assert at[1.0] - at[0.1] == pytest.approx(0.1, abs=0.01)
