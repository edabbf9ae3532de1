"""Forms with a shape parameter contain the simpler forms of the same effect, and describe other curves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taxel.gap.effects.catalogue import COUNTS_FORMS, OWN_EFFECTS, SIGNAL_FORMS
from taxel.gap.effects.signal_propagation import SignalPropagation

CONTAINED = [
    ("saturation", "soft", [600.0], "smooth", [600.0, 1.0]),
    ("stiffness", "", [0.7], "curved", [0.7, 1.0]),
    ("contact_propagation", "kept even", [3.0, 0.5], "kept power", [3.0, 0.5, 1.0]),
    ("contact_propagation", "added even", [3.0, 0.5], "added power", [3.0, 0.5, 1.0]),
    ("contact_propagation", "signal", [3.0, 0.5], "signal power", [3.0, 0.5, 1.0]),
    ("proximity", "exponential", [2.0, 80.0], "power", [2.0, 80.0, 1.0]),
]
"""Effect, simple form with its values, and form with a shape with the values at which both are equal."""


def find_form(name: str, variant: str):
    return next(form for form in OWN_EFFECTS[name] if (form.variant, form.scope) == (variant, "hand"))


def compute_signal(state, name: str, variant: str, values: list[float]) -> np.ndarray:
    """Return the simulated signal with a form of an effect, f64[Q, K, n] (Q contacts, K nodes, n taxels), counts."""
    changed = find_form(name, variant).apply(state, state.base, np.array(values)[:, None])
    return state.to_signal_counts(changed)


@pytest.mark.parametrize(("name", "simple", "values", "shaped", "equal"), CONTAINED, ids=[one[3] for one in CONTAINED])
def test_a_form_with_a_shape_contains_the_simple_form(state, name, simple, values, shaped, equal):
    expected = compute_signal(state, name, simple, values)
    assert np.abs(expected - state.signal_counts).max() > 10.0
    np.testing.assert_allclose(compute_signal(state, name, shaped, equal), expected, atol=1e-6)


def test_propagation_of_the_signal_keeps_the_sum_of_the_signals(state):
    """The sum changes only by the signal that would spread beyond the edges of the boards, at most a few per cent.

    Propagation of the force keeps the sum of the forces; the sum of the signals then increases, because the force law
    is steeper at small forces.
    """
    before = state.signal_counts.sum()
    by_signal = compute_signal(state, "contact_propagation", "counts power", [3.0, 0.5, 1.0]).sum()
    by_force = compute_signal(state, "contact_propagation", "kept power", [3.0, 0.5, 1.0]).sum()
    assert by_signal == pytest.approx(before, rel=0.05)
    assert by_force > 1.05 * before


@pytest.mark.parametrize("has_force", [True, False])
def test_forms_that_spread_the_signal_depend_on_the_contact_forces(state, has_force):
    """With contact forces, the counts spread, and the change has an uncertain place."""
    if not has_force:
        state = replace(state, base=replace(state.base, force=None, signal_counts=state.signal_counts))
    forms = [form for form in OWN_EFFECTS["contact_propagation"] if isinstance(form, SignalPropagation)]
    available = [form for form in forms if not form.find_unavailable_reason(state)]
    assert tuple(form.variant for form in available) == (COUNTS_FORMS if has_force else SIGNAL_FORMS)
    assert all((len(form.change_errors) > 1) == has_force for form in available)


def test_a_smooth_saturation_with_a_large_sharpness_clips(state):
    clipped = compute_signal(state, "saturation", "clip", [600.0])
    assert clipped.max() == pytest.approx(600.0)
    smooth = compute_signal(state, "saturation", "smooth", [600.0, 10.0])
    # At the limit itself the smooth curve is lower by the factor 2^(-1/10).
    np.testing.assert_allclose(smooth, clipped, atol=600.0 * (1.0 - 2.0**-0.1) + 1e-6)


def test_a_smooth_saturation_limits_signals_of_both_signs(state):
    form = find_form("saturation", "smooth")
    signals = state.base.with_signal_counts(-state.signal_counts)
    values = np.array([[600.0], [2.0]])
    limited = form.apply(state, signals, values).signal_counts
    np.testing.assert_allclose(limited, -compute_signal(state, "saturation", "smooth", [600.0, 2.0]))


def test_a_curved_layer_changes_no_force_at_half_the_full_scale(state):
    """With the exponent 0.5, small forces act larger and large forces smaller."""
    half = float(np.mean(state.sensor_model.half_force_n))
    force = np.array([0.25, 1.0, 4.0]) * half
    taxels = np.zeros_like(state.base.force)
    taxels[0, 0, :3] = force
    changed = find_form("stiffness", "curved").apply(state, state.base.with_force(taxels), np.array([[1.0], [0.5]]))
    assert changed.force[0, 0, :3] == pytest.approx(np.array([0.5, 1.0, 2.0]) * half)


def test_a_wide_kernel_spreads_more_evenly_than_an_exponential_kernel(state):
    """With the shape 6, a taxel keeps less of its force in comparison with its neighbours at one pitch."""
    loaded = np.unravel_index(state.base.force.argmax(), state.base.force.shape)
    force = np.zeros_like(state.base.force)
    force[loaded] = 1.0
    pitch_mm = 1e3 * state.pair.boards[0].pitch_m
    ratios = []
    for shape in (1.0, 6.0):
        values = np.array([[2.0 * pitch_mm], [1.0], [shape]])
        spread = find_form("contact_propagation", "kept power").apply(state, state.base.with_force(force), values)
        taxels = np.sort(spread.force[loaded[0], loaded[1]])[::-1]
        ratios.append(taxels[0] / taxels[1])
    assert ratios[1] < 1.2 < ratios[0]


def test_a_polynomial_curve_is_fixed_at_zero_and_at_the_full_scale(state):
    form = find_form("nonlinearity", "polynomial")
    scale = float(np.max(state.full_scale))
    signal = np.zeros_like(state.signal_counts)
    signal[0, 0, :4] = np.array([0.0, 0.5, -0.5, 1.0]) * scale
    bent = form.apply(state, state.base.with_signal_counts(signal), np.array([[0.4], [0.2]])).signal_counts
    # x (1 - 0.4 (1 - u) - 0.2 u (1 - u)) at u = 0.5 is x * 0.75.
    assert bent[0, 0, :4] == pytest.approx(np.array([0.0, 0.375, -0.375, 1.0]) * scale)


def test_a_drift_from_the_closing_is_proportional_to_the_time_since_closing(state):
    slope = 30.0
    change = compute_signal(state, "baseline_drift", "closing", [slope, 0.0]) - state.signal_counts
    expected = slope * state.node_times_s / state.node_times_s[-1]
    np.testing.assert_allclose(change, np.broadcast_to(expected[None, :, None], change.shape), atol=1e-9)
    earlier = compute_signal(state, "baseline_drift", "", [slope, 0.0]) - state.signal_counts
    assert (earlier[:, 0] > change[:, 0]).all()


def test_the_share_of_a_late_quantity_is_at_most_the_whole_quantity():
    shares = {
        form.variant: form.own_parameters()[0].high for form in OWN_EFFECTS["hysteresis"] if form.variant != "sticks"
    }
    assert shares == {"drop": 1.0, "gap": 1.0, "force": 1.0, "depth": 1.0, "more": 1.5}
