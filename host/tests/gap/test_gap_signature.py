"""What the remainder is said to look like, for distortions that were put in and are in no catalogue."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.reading import Groups
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.errors import GapInputError
from taxel.gap.features.features import (
    COUNTS_MISSING,
    Layout,
    features_of,
    known_mean,
    session_means,
    untouched_conditions,
)
from taxel.gap.fitting.judge import Judge
from taxel.gap.fitting.state import state_of
from taxel.gap.localisation.signature.bank import unexplained
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
    """A pair, and what the bare simulator leaves of it."""

    def __init__(self, paths) -> None:
        pair = self.pair = read_pair(*paths)
        layout = self.layout = Layout.of(pair.clock)
        untouched = untouched_conditions(pair)
        self.real, sim = (
            session_means(features_of(pair, own, layout, untouched), own, len(pair.conditions), sessions, layout)
            for own, sessions in ((pair.real, pair.sessions), (pair.sim, np.unique(pair.sim.session)))
        )
        self.model = known_mean(sim.value, 1)
        self.fold = Judge(state_of(pair, layout, np.nan_to_num(self.model)), self.real, layout).fold

    def told(self, real=None, model=None, fold=None):
        real = self.real if real is None else real
        model = self.model if model is None else model
        fold = self.fold if fold is None else fold
        found = unexplained(self.pair, self.layout, real, model, fold, 0)
        json.dumps(found, allow_nan=False)
        return found


@pytest.fixture(scope="module")
def plain(world, tmp_path_factory):
    """A pair in which nothing is distorted."""
    return Remainder(world(tmp_path_factory.mktemp("plain"), conditions=CONDITIONS, sessions=4))


@pytest.fixture
def told(world, tmp_path):
    """The report's `unexplained` of a world, without any effect of the catalogue."""
    return lambda **changes: Remainder(world(tmp_path, **changes)).told()


@pytest.fixture
def of_drop(plain):
    """The same where the mean drops [..., B, n] of every session are changed by a function."""

    def change(distortion):
        value, bins = plain.real.value.copy(), plain.layout.bins
        value[:, :, :bins] = distortion(value[:, :, :bins])
        return plain.told(real=replace(plain.real, value=value))

    return change


def of(found, name):
    return next(one for one in found["bank"] if one["name"] == name)


def first(found):
    return found["bank"][0]["name"]


def exchanged(signal_counts):
    grid = signal_counts.reshape(*signal_counts.shape[:-1], 2, ROWS, COLUMNS).copy()
    grid[..., 0, [2, 4], :] = grid[..., 0, [4, 2], :]
    return grid.reshape(signal_counts.shape)


def test_exchanged_lines_are_named(of_drop):
    found = of_drop(exchanged)
    assert first(found) == "row"
    assert "TX line 2 of a" in found["signature"]
    assert {(one["address"], one["axis"], one["index"]) for one in found["where"]} == {(0x20, "tx", 2), (0x20, "tx", 4)}
    assert sum(one["share"] for one in found["where"]) > 0.7


def test_a_weak_line_is_named_with_its_factor(of_drop):
    found = of_drop(
        lambda signal_counts: (
            signal_counts * np.where(np.arange(N) % COLUMNS == 3, np.where(np.arange(N) >= N // 2, 0.6, 1.0), 1.0)
        )
    )
    assert re.search("the hand has (39|40|41) % less signal, on RX line 3 of b;", found["signature"])
    assert [(one["address"], one["axis"], one["index"]) for one in found["where"]] == [(0x21, "rx", 3)]


def test_compressed_counts_are_a_curve_over_the_drop(of_drop):
    found = of_drop(lambda signal_counts: 20.0 * np.sqrt(np.maximum(signal_counts, 0.0)))
    assert found["signature"].startswith(("nonlinear in the signal", "grows with the signal, with a bend"))
    assert "counts below a predicted signal" in found["signature"]
    assert "on all boards" in found["signature"]
    assert of(found, "amplitude") == max(found["bank"], key=lambda one: one["share"])
    assert of(found, "amplitude")["scope"] == "hand"


def test_a_gain_factor_gives_a_linear_response_curve(of_drop):
    assert "the hand has 20 % less signal" in of_drop(lambda signal_counts: 0.8 * signal_counts)["signature"]


def test_a_stuck_bit_of_one_taxel_is_found_at_the_taxel(told):
    def stick(raw, valid, rng):
        raw = raw.copy()
        raw[:, 17] = raw[:, 17].astype(np.int64) | 0x300
        return raw, valid

    found = told(after=stick, conditions=8)
    assert found["where"][0]["index"] == 17
    assert "axis" not in found["where"][0]
    assert "taxel TX 3, RX 2 of a" in found["signature"]


def test_signal_loss_between_grasps_is_reported_with_the_remaining_signal(told):
    contacts = iter(range(10_000))

    def worn(force, signal_counts):
        return signal_counts * (1.0 - 0.015 * next(contacts))

    found = told(effect=worn, conditions=4, repeat_scatter=0.005, session_scatter=0.005)
    assert of(found, "session")["p_value"] < 0.05
    assert "the sensitivity differs between sessions by" in found["signature"]
    assert "decreasing from session to session" in found["signature"]


def test_signal_loss_within_each_session_is_reported_with_sign_and_size(told):
    contacts = iter(range(10_000))

    def tired(force, signal_counts):
        return signal_counts * (1.0 - 0.02 * (next(contacts) % 16))

    found = told(effect=tired, conditions=4, sessions=4, repeats=4, repeat_scatter=0.005)
    assert of(found, "presses")["p_value"] < 0.05
    size = re.search(r"the sensitivity decreases by ([\d.]+) % from the first to the last grasp", found["signature"])
    assert size
    assert float(size[1]) == pytest.approx(30.0, abs=2.0)


def test_latency_of_a_board_is_reported_in_seconds(told):
    def late(force, signal_counts):
        result = signal_counts.copy()
        result[3:, N // 2 :] = signal_counts[:-3, N // 2 :]
        return result

    found = told(effect=late, sessions=4, repeats=1)
    assert of(found, "lag")["share"] > 0.5
    assert "the signal of the hand is 0.1" in found["signature"]
    assert "s later, on b" in found["signature"]
    assert [one["address"] for one in found["where"]] == [0x21]


def test_a_remaining_signal_after_release_is_reported_as_history(of_drop, plain):
    later = np.isin(plain.layout.phase[: plain.layout.bins], [Phase.RELEASE, Phase.RECOVERY])

    def sticky(signal_counts):
        hold = signal_counts[:, :, plain.pair.clock.bins_of(Phase.HOLD)]
        return np.where(later[:, None], np.maximum(signal_counts, 0.15 * hold), signal_counts)

    found = of_drop(sticky)
    assert first(found) == "history"
    assert "decays too slowly" in found["signature"]
    assert "15.0 % of the hold signal more than predicted in recovery" in found["signature"]


def test_a_contact_patch_that_is_too_wide_is_reported_as_radial(of_drop):
    def blurred(signal_counts):
        grid = signal_counts.reshape(*signal_counts.shape[:-1], 2, ROWS, COLUMNS)
        grid = np.pad(grid, [(0, 0)] * (grid.ndim - 2) + [(1, 1), (1, 1)], mode="edge")
        mean = (grid[..., :-2, 1:-1] + grid[..., 2:, 1:-1] + grid[..., 1:-1, :-2] + grid[..., 1:-1, 2:]) / 4.0
        return 0.6 * signal_counts + 0.4 * mean.reshape(signal_counts.shape)

    found = of_drop(blurred)
    assert first(found) == "radial"
    assert "wider" in found["signature"]


def test_taxels_that_move_together_are_common(of_drop):
    found = of_drop(lambda signal_counts: signal_counts - 0.4 * signal_counts.mean(axis=-1, keepdims=True))
    assert first(found) == "common"
    assert "have a negative signal" in found["signature"]


def test_a_noisy_board_is_reported_with_its_location(plain):
    value = plain.real.value.copy()
    value[:, :, plain.layout.noise, : N // 2] += 60.0
    found = plain.told(real=replace(plain.real, value=value))
    assert first(found) == "noise"
    assert re.search(r"the noise of the hand is larger by (59\.\d|60|60\.\d) counts, on a", found["signature"])
    assert [one["address"] for one in found["where"]] == [0x20]


def test_lost_frames_are_reported_as_missing(plain):
    value = plain.real.value.copy()
    value[:, :, plain.layout.missing, N // 2 :] += 0.3 * COUNTS_MISSING
    found = plain.told(real=replace(plain.real, value=value))
    assert first(found) == "missing"
    assert "more frames are missing (30.0 %), on b" in found["signature"]


def test_without_a_distortion_no_signature_is_reported(plain):
    found = plain.told()
    assert found["where"] == []
    assert "what is left" not in found["signature"]
    assert {one["name"] for one in found["bank"]} == BANK


def test_variance_between_repeats_alone_gives_no_signature(told):
    found = told(seed=51, session_scatter=0.08, repeat_scatter=0.05)
    tested = [one for one in found["bank"] if one["name"] not in ("session", "presses")]
    assert min(one["p_value"] for one in tested) > 0.05


def test_a_distortion_unlike_every_signature_is_not_named(of_drop):
    # a pattern of its own in every cell: nothing that one press tells holds for another
    patterns = np.random.default_rng(3).normal(0.0, 120.0, (CONDITIONS, 1, 1, N))
    found = of_drop(
        lambda signal_counts: signal_counts + patterns * (signal_counts.max(axis=-1, keepdims=True) > 300.0)
    )
    assert "not significantly similar" in found["signature"]
    assert "mostly in" in found["signature"]
    assert {one["name"] for one in found["where"]} == {"a", "b"}


@pytest.mark.parametrize(
    "changes", [{"sessions": 1}, {"sessions": 2}, {"cells": 1}, {"cells": 1, "sessions": 1, "repeats": 1}]
)
def test_few_sessions_and_conditions_are_reported_without_a_p_value(told, changes):
    found = told(**{"cells": 3, "effect": lambda force, signal_counts: 0.7 * signal_counts, **changes})
    if changes.get("sessions", 5) < 3:
        assert all(one["p_value"] is None for one in found["bank"] if one["name"] not in ("session", "presses"))
        assert not found["where"] or found["signature"].startswith("possibly proportional to the signal")
    else:
        assert re.search("the hand has (29|30|31) % less signal", found["signature"])


def test_unknown_features_and_sessions_give_no_signature(plain):
    value = plain.real.value.copy()
    value[:, :, : plain.layout.bins] *= 0.8
    weak = replace(plain.real, value=value.copy())
    value[0, 1] = np.nan  # a session without a cell
    value[:, 2, :, : N // 2] = np.nan  # one in which a board was silent
    value[:, :, plain.layout.onset] = np.nan
    assert "20 % less" in plain.told(real=replace(plain.real, value=value))["signature"]
    model = plain.model.copy()
    model[:, plain.layout.onset] = np.nan
    model[:, :, 4] = np.nan
    assert "20 % less" in plain.told(real=weak, model=model)["signature"]
    assert "20 % less" in plain.told(real=weak, fold=np.zeros(CONDITIONS, np.intp))["signature"]
    for real, predicted in (
        (weak, np.full_like(model, np.nan)),
        (replace(weak, value=np.full_like(value, np.nan)), model),
    ):
        assert plain.told(real=real, model=predicted)["signature"] == ""
    plain.told(real=weak, model=np.zeros_like(model))


def test_a_signature_is_reported_without_forces_and_with_one_board(of_drop, plain, monkeypatch):
    pair = plain.pair
    one = SensorTable(pair.sensors.address[:1], ("only",), ("k",), pair.sensors.rate_hz[:1])
    groups = Groups(np.zeros(N, np.intp), pair.groups.tx, pair.groups.rx)
    sim = replace(pair.sim, force=None, separation=None)
    monkeypatch.setattr(plain, "pair", replace(pair, sensors=one, groups=groups, sim=sim, sensor_model=None))
    found = of_drop(lambda signal_counts: 0.8 * signal_counts)
    assert "20 % less" in found["signature"]


def test_report_and_page_contain_the_signatures(world, tmp_path):
    paths = world(tmp_path, sessions=4, effect=lambda force, signal_counts: exchanged(signal_counts))
    report = diagnose(*paths, without=set(OWN_EFFECTS) - {"gain_mismatch"}).report
    report = json.loads(json.dumps(report, allow_nan=False))
    left = report["unexplained"]
    assert set(left) == {"p_value", "signature", "where", "bank"}
    assert {one["name"] for one in left["bank"]} == BANK
    report["unexplained"]["p_value"] = 0.001
    page = page_text(report)
    assert "Generic distortions" in page
    assert "TX lines: a different signal" in page
    assert '<p class="signature">' in page
    left["bank"] = [{"name": "<new>_kind", "scope": "hand", "share": 0.4, "p_value": None}]
    page = page_text(report)
    assert "&lt;new&gt; kind" in page
    left["bank"][0]["share"] = "much"
    with pytest.raises(GapInputError, match=r"unexplained\.bank\[0\]\.share"):
        page_text(report)
    del left["bank"]
    assert "The bank of distortions" not in page_text(report)
