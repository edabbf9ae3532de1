"""Signature of the unattributed remainder, for known distortions that are outside the catalogue."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.reading import TaxelGroups
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.errors import GapInputError
from taxel.gap.features.features import (
    COUNTS_MISSING,
    FeatureLayout,
    compute_features,
    compute_known_mean,
    compute_session_means,
    find_unloaded_taxels,
)
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.fitting.state import build_state
from taxel.gap.localisation.signature.bank import describe_unexplained
from taxel.gap.page import page_text
from taxel.recording import SensorTable
from taxel.recording.grasp_format import Phase

ROWS, COLUMNS, N = 6, 5, 60
CONDITIONS = 8
BANK = {
    "amplitude", "lag", "history", "radial", "shift", "common", "board", "row", "column", "taxel", "noise", "missing",
    "wander", "session", "presses",
}  # fmt: skip


class Remainder:
    """A dataset pair and its remainder without any effect of the catalogue."""

    def __init__(self, paths) -> None:
        pair = self.pair = read_pair(*paths)
        layout = self.layout = FeatureLayout.from_time_grid(pair.time_grid)
        untouched = find_unloaded_taxels(pair)
        self.real, sim = (
            compute_session_means(
                compute_features(pair, side, layout, untouched), side, len(pair.conditions), sessions, layout
            )
            for side, sessions in ((pair.real, pair.sessions), (pair.sim, np.unique(pair.sim.session)))
        )
        self.model = compute_known_mean(sim.value, 1)
        self.fold = FitData(build_state(pair, layout, np.nan_to_num(self.model)), self.real, layout).condition_folds

    def describe(self, real=None, model=None, fold=None):
        """Return the field `unexplained` of the report, which must be valid JSON. real, model, fold: other inputs;
        None: those of the pair.
        """
        real = self.real if real is None else real
        model = self.model if model is None else model
        fold = self.fold if fold is None else fold
        found = describe_unexplained(self.pair, self.layout, real, model, fold, 0)
        json.dumps(found, allow_nan=False)
        return found


@pytest.fixture(scope="module")
def undistorted(write_world, tmp_path_factory):
    """The remainder of a pair without a distortion."""
    return Remainder(write_world(tmp_path_factory.mktemp("plain"), conditions=CONDITIONS, sessions=4))


@pytest.fixture
def describe_world(write_world, tmp_path):
    """Function that returns the field `unexplained` of the report of a world, without any effect of the catalogue."""
    return lambda **changes: Remainder(write_world(tmp_path, **changes)).describe()


@pytest.fixture
def describe_distorted_signal(undistorted):
    """Function that returns `unexplained` after a distortion of the mean signal [..., B, n] of every session."""

    def describe(distortion):
        value, bins = undistorted.real.value.copy(), undistorted.layout.bins
        value[:, :, :bins] = distortion(value[:, :, :bins])
        return undistorted.describe(real=replace(undistorted.real, value=value))

    return describe


def get_entry(found, name):
    return next(one for one in found["bank"] if one["name"] == name)


def get_first_name(found):
    return found["bank"][0]["name"]


def exchange_lines(signal_counts):
    """Exchange the lines TX 2 and TX 4 of the first board."""
    grid = signal_counts.reshape(*signal_counts.shape[:-1], 2, ROWS, COLUMNS).copy()
    grid[..., 0, [2, 4], :] = grid[..., 0, [4, 2], :]
    return grid.reshape(signal_counts.shape)


def test_exchanged_lines_are_named(describe_distorted_signal):
    found = describe_distorted_signal(exchange_lines)
    assert get_first_name(found) == "row"
    assert "TX line 2 of a" in found["signature"]
    assert {(one["address"], one["axis"], one["index"]) for one in found["where"]} == {(0x20, "tx", 2), (0x20, "tx", 4)}
    assert sum(one["share"] for one in found["where"]) > 0.7


def test_a_weak_line_is_named_with_its_factor(describe_distorted_signal):
    found = describe_distorted_signal(
        lambda signal_counts: (
            signal_counts * np.where(np.arange(N) % COLUMNS == 3, np.where(np.arange(N) >= N // 2, 0.6, 1.0), 1.0)
        )
    )
    assert re.search("the hand has (39|40|41) % less signal, on RX line 3 of b;", found["signature"])
    assert [(one["address"], one["axis"], one["index"]) for one in found["where"]] == [(0x21, "rx", 3)]


def test_compressed_counts_are_described_as_a_nonlinear_response_curve(describe_distorted_signal):
    found = describe_distorted_signal(lambda signal_counts: 20.0 * np.sqrt(np.maximum(signal_counts, 0.0)))
    assert found["signature"].startswith(("nonlinear in the signal", "grows with the signal, with a bend"))
    assert "counts below a predicted signal" in found["signature"]
    assert "on all boards" in found["signature"]
    assert get_entry(found, "amplitude") == max(found["bank"], key=lambda one: one["share"])
    assert get_entry(found, "amplitude")["scope"] == "hand"


def test_a_gain_factor_is_described_as_a_proportional_signal(describe_distorted_signal):
    assert (
        "the hand has 20 % less signal"
        in describe_distorted_signal(lambda signal_counts: 0.8 * signal_counts)["signature"]
    )


def test_a_stuck_bit_of_one_taxel_is_found_at_the_taxel(describe_world):
    def set_bits(raw, valid, rng):
        raw = raw.copy()
        raw[:, 17] = raw[:, 17].astype(np.int64) | 0x300
        return raw, valid

    found = describe_world(raw_effect=set_bits, conditions=8)
    assert found["where"][0]["index"] == 17
    assert "axis" not in found["where"][0]
    assert "taxel TX 3, RX 2 of a" in found["signature"]


def test_sensitivity_that_decreases_from_grasp_to_grasp_is_reported_with_its_direction(describe_world):
    contacts = iter(range(10_000))

    def weaken_with_each_contact(force, signal_counts):
        return signal_counts * (1.0 - 0.015 * next(contacts))

    found = describe_world(effect=weaken_with_each_contact, conditions=4, repeat_std=0.005, session_std=0.005)
    assert get_entry(found, "session")["p_value"] < 0.05
    assert "the sensitivity differs between sessions by" in found["signature"]
    assert "decreasing from session to session" in found["signature"]


def test_sensitivity_that_decreases_within_each_session_is_reported_with_its_size(describe_world):
    contacts = iter(range(10_000))

    def weaken_within_session(force, signal_counts):
        return signal_counts * (1.0 - 0.02 * (next(contacts) % 16))  # a session has 4 x 4 grasps: the last loses 30 %

    found = describe_world(effect=weaken_within_session, conditions=4, sessions=4, repeats=4, repeat_std=0.005)
    assert get_entry(found, "presses")["p_value"] < 0.05
    size = re.search(r"the sensitivity decreases by ([\d.]+) % from the first to the last grasp", found["signature"])
    assert size
    assert float(size[1]) == pytest.approx(30.0, abs=2.0)


def test_latency_of_a_board_is_reported_in_seconds_with_the_board(describe_world):
    def delay_second_board(force, signal_counts):
        result = signal_counts.copy()
        result[3:, N // 2 :] = signal_counts[:-3, N // 2 :]
        return result

    found = describe_world(effect=delay_second_board, sessions=4, repeats=1)
    assert get_entry(found, "lag")["share"] > 0.5
    # Three frames at 20 Hz are 0.15 s.
    assert "the signal of the hand is 0.1" in found["signature"]
    assert "s later, on b" in found["signature"]
    assert [one["address"] for one in found["where"]] == [0x21]


def test_a_remaining_signal_after_release_is_reported_as_history(describe_distorted_signal, undistorted):
    later = np.isin(undistorted.layout.phase[: undistorted.layout.bins], [Phase.RELEASE, Phase.RECOVERY])

    def keep_hold_signal(signal_counts):
        hold = signal_counts[:, :, undistorted.pair.time_grid.find_bins(Phase.HOLD)]
        return np.where(later[:, None], np.maximum(signal_counts, 0.15 * hold), signal_counts)

    found = describe_distorted_signal(keep_hold_signal)
    assert get_first_name(found) == "history"
    assert "decays too slowly" in found["signature"]
    assert "15.0 % of the hold signal more than predicted in recovery" in found["signature"]


def test_a_contact_patch_that_is_too_wide_is_reported_as_radial(describe_distorted_signal):
    def blur_signal(signal_counts):
        grid = signal_counts.reshape(*signal_counts.shape[:-1], 2, ROWS, COLUMNS)
        grid = np.pad(grid, [(0, 0)] * (grid.ndim - 2) + [(1, 1), (1, 1)], mode="edge")
        mean = (grid[..., :-2, 1:-1] + grid[..., 2:, 1:-1] + grid[..., 1:-1, :-2] + grid[..., 1:-1, 2:]) / 4.0
        return 0.6 * signal_counts + 0.4 * mean.reshape(signal_counts.shape)

    found = describe_distorted_signal(blur_signal)
    assert get_first_name(found) == "radial"
    assert "wider" in found["signature"]


def test_a_common_change_of_all_taxels_is_reported_as_common(describe_distorted_signal):
    found = describe_distorted_signal(
        lambda signal_counts: signal_counts - 0.4 * signal_counts.mean(axis=-1, keepdims=True)
    )
    assert get_first_name(found) == "common"
    assert "have a negative signal" in found["signature"]


def test_a_noisy_board_is_reported_with_its_location(undistorted):
    value = undistorted.real.value.copy()
    value[:, :, undistorted.layout.noise, : N // 2] += 60.0
    found = undistorted.describe(real=replace(undistorted.real, value=value))
    assert get_first_name(found) == "noise"
    assert re.search(r"the noise of the hand is larger by (59\.\d|60|60\.\d) counts, on a", found["signature"])
    assert [one["address"] for one in found["where"]] == [0x20]


def test_lost_frames_are_reported_as_missing(undistorted):
    value = undistorted.real.value.copy()
    # This feature is the share of missing frames times COUNTS_MISSING.
    value[:, :, undistorted.layout.missing, N // 2 :] += 0.3 * COUNTS_MISSING
    found = undistorted.describe(real=replace(undistorted.real, value=value))
    assert get_first_name(found) == "missing"
    assert "more frames are missing (30.0 %), on b" in found["signature"]


def test_without_a_distortion_no_signature_is_reported(undistorted):
    found = undistorted.describe()
    assert found["where"] == []
    assert found["signature"] == ""
    assert {one["name"] for one in found["bank"]} == BANK


def test_variance_between_repeats_alone_gives_no_signature(describe_world):
    found = describe_world(seed=51, session_std=0.08, repeat_std=0.05)
    tested = [one for one in found["bank"] if one["name"] not in ("session", "presses")]
    assert min(one["p_value"] for one in tested) > 0.05


def test_a_distortion_unlike_every_signature_is_not_named(describe_distorted_signal):
    # each condition has its own random pattern: no pattern is common to two contacts
    patterns = np.random.default_rng(3).normal(0.0, 120.0, (CONDITIONS, 1, 1, N))
    found = describe_distorted_signal(
        lambda signal_counts: signal_counts + patterns * (signal_counts.max(axis=-1, keepdims=True) > 300.0)
    )
    assert "not significantly similar" in found["signature"]
    assert "mostly in" in found["signature"]
    assert {one["name"] for one in found["where"]} == {"a", "b"}


@pytest.mark.parametrize(
    "changes", [{"sessions": 1}, {"sessions": 2}, {"conditions": 1}, {"conditions": 1, "sessions": 1, "repeats": 1}]
)
def test_few_sessions_and_conditions_are_reported_without_a_p_value(describe_world, changes):
    found = describe_world(**{"conditions": 3, "effect": lambda force, signal_counts: 0.7 * signal_counts, **changes})
    if changes.get("sessions", 5) < 3:
        assert all(one["p_value"] is None for one in found["bank"] if one["name"] not in ("session", "presses"))
        assert not found["where"] or found["signature"].startswith("possibly proportional to the signal")
    else:
        assert re.search("the hand has (29|30|31) % less signal", found["signature"])


def test_a_signature_is_found_despite_unknown_features_and_sessions(undistorted):
    value, model = undistorted.real.value.copy(), undistorted.model.copy()
    value[:, :, : undistorted.layout.bins] *= 0.8
    weak = replace(undistorted.real, value=value.copy())
    value[0, 1] = np.nan  # a session without a condition
    value[:, 2, :, : N // 2] = np.nan  # a session without a signal of one board
    value[:, :, undistorted.layout.onset] = np.nan
    assert "20 % less" in undistorted.describe(real=replace(undistorted.real, value=value))["signature"]
    model[:, undistorted.layout.onset] = np.nan
    model[:, :, 4] = np.nan  # a taxel without a prediction
    assert "20 % less" in undistorted.describe(real=weak, model=model)["signature"]


def test_a_signature_is_found_with_a_single_fold(undistorted):
    value = undistorted.real.value.copy()
    value[:, :, : undistorted.layout.bins] *= 0.8
    found = undistorted.describe(real=replace(undistorted.real, value=value), fold=np.zeros(CONDITIONS, np.intp))
    assert "20 % less" in found["signature"]


def test_there_is_no_signature_without_any_known_feature_on_one_side(undistorted):
    real, model = undistorted.real, undistorted.model
    unknown_real = replace(real, value=np.full_like(real.value, np.nan))
    assert undistorted.describe(real=real, model=np.full_like(model, np.nan))["signature"] == ""
    assert undistorted.describe(real=unknown_real, model=model)["signature"] == ""


def test_a_prediction_without_any_signal_gives_a_valid_report_field(undistorted):
    assert {one["name"] for one in undistorted.describe(model=np.zeros_like(undistorted.model))["bank"]} <= BANK


def test_a_signature_is_reported_without_forces_and_with_one_board(describe_distorted_signal, undistorted, monkeypatch):
    pair = undistorted.pair
    one_sensor = SensorTable(pair.sensors.address[:1], ("only",), ("k",), pair.sensors.rate_hz[:1])
    groups = TaxelGroups(np.zeros(N, np.intp), pair.groups.tx, pair.groups.rx)
    sim = replace(pair.sim, force=None, separation=None)
    one_board = replace(pair, sensors=one_sensor, groups=groups, sim=sim, sensor_model=None)
    monkeypatch.setattr(undistorted, "pair", one_board)
    found = describe_distorted_signal(lambda signal_counts: 0.8 * signal_counts)
    assert "20 % less" in found["signature"]


def test_report_and_page_contain_the_signatures(write_world, tmp_path):
    paths = write_world(tmp_path, sessions=4, effect=lambda force, signal_counts: exchange_lines(signal_counts))
    report = diagnose(*paths, without=set(OWN_EFFECTS) - {"gain_mismatch"}).report
    report = json.loads(json.dumps(report, allow_nan=False))
    remainder = report["unexplained"]
    assert set(remainder) == {"p_value", "signature", "where", "bank"}
    assert {one["name"] for one in remainder["bank"]} == BANK
    report["unexplained"]["p_value"] = 0.001
    page = page_text(report)
    assert "Generic distortions" in page
    assert "TX lines: a different signal" in page
    assert '<p class="signature">' in page
    remainder["bank"] = [{"name": "<new>_kind", "scope": "hand", "share": 0.4, "p_value": None}]
    page = page_text(report)
    assert "&lt;new&gt; kind" in page
    remainder["bank"][0]["share"] = "much"
    with pytest.raises(GapInputError, match=r"unexplained\.bank\[0\]\.share"):
        page_text(report)
    del remainder["bank"]
    assert "The bank of distortions" not in page_text(report)
