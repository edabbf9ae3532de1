"""The gap by the four steps of the thesis: each step removes the difference for which it is made."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from taxel.cloud.treatment import DEFAULT_OUTLIER_FILTER, OutlierFilter, get_outlier_filter
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.features.cloud_gap import compute_cloud_gap
from taxel.gap.features.metric import Interval, measure_gap
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.report.thesis_terms import GRASPS_PER_APPROACH, build_thesis_terms, find_outliers

ROWS, COLUMNS, N = 6, 5, 60
HALF = N // 2
STEPS = ["unfiltered", "force filter", "+ SOR", "+ contact propagation"]
NO_FITS = {}  # no effect was fitted alone


@pytest.fixture(scope="module")
def get_fit_data(get_world_paths):
    """Function that returns the `FitData` of a world, computed once."""
    return cache(lambda **changes: prepare_pair(read_pair(*get_world_paths(**changes))))


@pytest.fixture(scope="module")
def get_steps(get_fit_data):
    """Function that returns the four steps of a world, computed once."""
    return cache(lambda **changes: build_thesis_terms(get_fit_data(**changes), NO_FITS))


def list_distances_mm(entries) -> list[float]:
    return [entry["mm"] for entry in entries]


def spread_force(force, signal_counts):
    """Spread the forces on each board with a kernel that decays over 3 mm, and convert them into counts."""
    x, y = np.arange(ROWS)[:, None], np.arange(COLUMNS)
    places = np.stack([np.repeat(x, COLUMNS, axis=1).ravel(), np.tile(y, ROWS)], axis=1) * 5.0
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    kernel = np.exp(-apart / 3.0)
    kernel /= kernel.sum(axis=1, keepdims=True)
    moved = np.concatenate([part @ kernel for part in np.split(force, 2, axis=1)], axis=1)
    return 2000.0 * moved / (moved + 1.5)


def add_far_point(force, signal_counts):
    """Give a signal to the taxel of the loaded board that is farthest from the contact patch."""
    pressed = force.max(axis=0) > 0
    result, board = signal_counts.copy(), HALF * int(np.flatnonzero(pressed)[0] // HALF)
    number = np.arange(HALF)
    places = np.stack([number // COLUMNS, number % COLUMNS], axis=1)
    patch = places[pressed[board : board + HALF]]
    apart = np.linalg.norm(places[:, None] - patch, axis=2).min(axis=1)
    result[:, board + int(apart.argmax())] = 400.0 * (force.max(axis=1) > 0)
    return result


def add_halo(force, signal_counts):
    """Give all taxels of a loaded board at least 165 counts: above the activation threshold, below the force filter."""
    pressed = np.repeat(force.reshape(-1, 2, HALF).max(axis=2) > 0, HALF, axis=1)
    return np.maximum(signal_counts, 165.0 * pressed)


def test_the_four_steps_are_in_the_order_of_the_thesis(get_fit_data, get_steps):
    fit_data, entries = get_fit_data(effect=spread_force), get_steps(effect=spread_force)
    assert [entry["step"] for entry in entries] == STEPS
    expected_mm = compute_cloud_gap(fit_data.state.pair, fit_data.sessions, fit_data.state.mean, 0)["value"]
    assert entries[0]["mm"] == entries[0]["mm_hand_only"] == pytest.approx(expected_mm)
    assert entries[0]["gap"] == pytest.approx(
        measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout).gap.value
    )
    assert entries[1]["gap"] is entries[2]["gap"] is None  # the filters change only clouds, not signals
    real, sim = ([entry["points"][side] for entry in entries] for side in ("real", "sim"))
    # The filters remove points of both clouds; contact propagation adds points to the simulated cloud.
    assert real[0] > real[1] >= real[2] == real[3]
    assert sim[0] > sim[1] >= sim[2] < sim[3]
    json.dumps(entries, allow_nan=False)


def test_intervals_of_distances_are_clipped_at_zero():
    assert Interval(2.0, -1.0, 5.0, 1.0).non_negative.ci95 == [0.0, 5.0]
    assert Interval(2.0, None, None, None).non_negative.ci95 is None


def test_the_threshold_of_the_force_filter_is_stated_in_newtons(get_steps):
    note = get_steps()[1]["note"]
    assert note == "signal of 190 counts, 0.157 N in the simulator's sensor model"  # 2000 F / (F + 1.5)


def test_contact_propagation_closes_a_gap_caused_by_contact_propagation(get_steps):
    entries = get_steps(effect=spread_force)
    before, force_filtered, outlier_filtered, after = list_distances_mm(entries)
    assert after < 0.3 * before
    # Both filters together reduce the distance by less than half of the reduction by contact propagation.
    assert before - min(force_filtered, outlier_filtered) < 0.5 * (outlier_filtered - after)
    assert entries[3]["gap"] < 0.3 * entries[0]["gap"]


def test_an_isolated_false_point_is_removed_by_the_outlier_filter(get_steps):
    before, force_filtered, outlier_filtered, after = list_distances_mm(get_steps(effect=add_far_point, conditions=2))
    assert force_filtered > 0.8 * before
    assert outlier_filtered < 0.5 * force_filtered
    assert after > 0.8 * outlier_filtered


def test_a_weak_halo_is_removed_by_the_force_filter(get_steps):
    entries = get_steps(effect=add_halo, conditions=4, sessions=3)
    before, force_filtered, _, _ = list_distances_mm(entries)
    assert force_filtered < 0.6 * before
    assert entries[1]["points"]["real"] < 0.6 * entries[0]["points"]["real"]


def test_filtering_only_the_real_cloud_creates_a_gap(get_steps):
    entries = get_steps()
    assert all(value < 1.2 * entries[0]["mm"] for value in list_distances_mm(entries))
    assert entries[2]["mm_hand_only"] > 2.0 * entries[0]["mm"]


def test_without_a_gap_contact_propagation_adds_nothing(get_steps):
    entries = get_steps()
    assert entries[3]["mm"] == pytest.approx(entries[2]["mm"], abs=0.05)
    assert entries[3]["points"]["sim"] == pytest.approx(entries[2]["points"]["sim"], rel=0.02)


def test_an_existing_fit_of_contact_propagation_is_reused(get_fit_data):
    fit_data = get_fit_data(effect=spread_force)
    effect = OWN_EFFECTS["contact_propagation"][0]
    composite = CompositeModel((FittedEffect(effect, effect.make_neutral_values(fit_data.state)),))
    entries = build_thesis_terms(fit_data, {"contact_propagation": (composite, fit_data.state.mean)})
    assert entries[3]["gap"] == pytest.approx(entries[0]["gap"])
    assert entries[3]["note"].endswith("strength 0")


def test_without_simulated_forces_the_last_step_states_why_it_is_missing(get_fit_data):
    pair = get_fit_data(effect=spread_force).state.pair
    sim_without_force = replace(pair.sim, force=None, separation=None)
    forceless = replace(pair, sim=sim_without_force, sensor_model=None, missing_inputs=frozenset({"geometry"}))
    entries = build_thesis_terms(prepare_pair(forceless), NO_FITS)
    assert entries[3]["step"] == "contact propagation: not added, the simulation has no contact force"
    assert entries[3]["mm"] is entries[3]["gap"] is None
    assert entries[1]["note"] == "signal of 190 counts; the simulation has no sensor model"
    assert all(entry["mm"] is not None for entry in entries[:3])


@pytest.mark.parametrize(
    "changes",
    [
        {"sessions": 1, "repeats": 1},
        {"conditions": 1},
        {"conditions": 1, "sessions": 1, "repeats": 1},
        {"conditions": 2, "sessions": 3, "effect": lambda force, signal_counts: 0.0 * signal_counts},
        {"conditions": 2, "sessions": 3, "largest_force_n": 0.0},
        {"conditions": 2, "sessions": 3, "effect": add_far_point, "largest_force_n": 0.0001},
    ],
    ids=["one session", "one condition", "one grasp", "no real signal", "no contact", "one point"],
)
def test_sparse_data_give_four_steps_with_finite_distances(get_steps, changes):
    entries = get_steps(**changes)
    assert len(entries) == 4
    assert all(np.isfinite(entry["mm"]) and entry["mm"] >= 0.0 for entry in entries)
    json.dumps(entries, allow_nan=False)


def grid(rows: int, columns: int) -> np.ndarray:
    """Return the positions of a grid of taxels with a pitch of 5 mm, metres, f64[rows * columns, 3]."""
    x, y = np.meshgrid(0.005 * np.arange(rows), 0.005 * np.arange(columns), indexing="ij")
    return np.stack([x.ravel(), y.ravel(), 0.0 * x.ravel()], axis=1)


def test_the_outlier_filter_removes_an_isolated_point():
    places = np.concatenate([grid(5, 5), [[0.06, 0.06, 0.0]]])
    assert np.flatnonzero(find_outliers(places, np.ones(26), DEFAULT_OUTLIER_FILTER)).tolist() == [25]


def test_the_outlier_filter_agrees_with_a_point_by_point_computation():
    seed = 4
    places = np.random.default_rng(seed).uniform(0.0, 0.1, (80, 3))
    cloud = np.repeat(places, int(GRASPS_PER_APPROACH), axis=0)  # a taxel that is active in every grasp
    apart = np.sort(np.linalg.norm(cloud[:, None] - cloud, axis=2), axis=1)[:, 1:]
    for n_neighbours in (20, 700):
        # The point itself is one of the neighbours, at the distance 0, which `apart` omits.
        mean = apart[:, : n_neighbours - 1].mean(axis=1)
        expected = (mean > mean.mean() + mean.std())[:: int(GRASPS_PER_APPROACH)]
        found = find_outliers(places, np.ones(80), OutlierFilter(n_neighbours, 1.0))
        assert expected.any(), f"seed {seed}"
        assert (found == expected).all(), f"seed {seed}"


def test_points_with_too_few_neighbours_are_kept():
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    assert not find_outliers(places, np.ones(2), OutlierFilter(20.0, 0.5)).any()
    assert not find_outliers(places, np.array([1.0, 0.0]), DEFAULT_OUTLIER_FILTER).any()
    assert not find_outliers(places[:0], np.zeros(0), DEFAULT_OUTLIER_FILTER).any()


def test_equal_distances_contain_no_outlier():
    ring = 2.0 * np.pi * np.arange(40) / 40
    places = np.stack([np.cos(ring), np.sin(ring), 0.0 * ring], axis=1)
    assert not find_outliers(places, np.ones(40), OutlierFilter(20.0, 0.0)).any()


def test_each_shape_has_the_filter_settings_of_the_thesis():
    assert get_outlier_filter("rectangular_prism") == OutlierFilter(20.0, 1.0)
    assert get_outlier_filter("cylinder") == OutlierFilter(20.0, 2.0)
    assert get_outlier_filter("Triangular prism") == OutlierFilter(None, 2.0)
    assert get_outlier_filter("mug") == DEFAULT_OUTLIER_FILTER
