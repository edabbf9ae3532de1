"""Diagnosis of small synthetic worlds with one known effect or without an effect."""

from __future__ import annotations

import json

import numpy as np
import pytest

from host.tests.gap.stiffer_layer import stiffen
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.errors import GapInputError
from taxel.gap.page import write_page

ROWS, COLUMNS, N = 6, 5, 60


def compute_line_mean(signal_counts: np.ndarray, axis: int) -> np.ndarray:
    """Return the mean signal of the other taxels on the line (axis 0: TX line, axis 1: RX line)."""
    grid = signal_counts.reshape(-1, 2, ROWS, COLUMNS)
    count = grid.shape[3 - axis]
    total = grid.sum(axis=3 - axis, keepdims=True)
    return ((total - grid) / (count - 1)).reshape(signal_counts.shape)


def add_crosstalk(force, signal_counts):
    return signal_counts + 0.15 * compute_line_mean(signal_counts, 0) + 0.25 * compute_line_mean(signal_counts, 1)


def clip_signal(force, signal_counts):
    return np.minimum(signal_counts, 500.0)


def add_creep(force, signal_counts):
    """Let 40 % of the signal follow with a time constant of 0.5 s."""
    late = np.zeros_like(signal_counts)
    for k in range(1, len(signal_counts)):
        late[k] = late[k - 1] + (1 - np.exp(-0.05 / 0.5)) * (signal_counts[k] - late[k - 1])
    return 0.6 * signal_counts + 0.4 * late


def delay_first_board(force, signal_counts):
    """Delay the signal of the first board by 4 frames."""
    late = signal_counts.copy()
    late[4:, : N // 2] = signal_counts[:-4, : N // 2]
    return late


def spread_force(force, signal_counts):
    """Spread the forces on each board with a kernel that decays over 3 mm, and convert them into counts."""
    x, y = np.arange(ROWS)[:, None], np.arange(COLUMNS)
    places = np.stack([np.repeat(x, COLUMNS, axis=1).ravel(), np.tile(y, ROWS)], axis=1) * 5.0
    distance = np.linalg.norm(places[:, None] - places, axis=2)
    kernel = np.exp(-distance / 3.0)
    kernel /= kernel.sum(axis=1, keepdims=True)
    moved = np.concatenate([part @ kernel for part in np.split(force, 2, axis=1)], axis=1)
    return 2000.0 * moved / (moved + 1.5)


EFFECTS = {
    "electrode_crosstalk": add_crosstalk,
    "saturation": clip_signal,
    "stiffness": stiffen,
    "hysteresis": add_creep,
    "latency": delay_first_board,
    "contact_propagation": spread_force,
}


def test_without_an_effect_there_is_no_gap(get_report):
    report = get_report()
    assert report["verdict"]["status"] == "no_gap"
    assert report["verdict"]["effects"] == []
    assert report["gap"]["value"] < 2.0 * report["gap"]["floor"]


@pytest.mark.parametrize("name", EFFECTS)
def test_the_applied_effect_is_named_first(get_report, name):
    report = get_report(effect=EFFECTS[name])
    assert report["gap"]["significant"]
    assert report["verdict"]["effects"][0] == name
    assert abs(report["after"]["predicted_shrink"] - report["after"]["shrink"]) < 0.05
    entry = next(one for one in report["effects"] if one["name"] == name)
    assert 0.0 < entry["measured_shrink"] == pytest.approx(entry["predicted_shrink"], abs=0.05)


def test_the_applied_parameters_are_recovered(get_report):
    report = get_report(effect=clip_signal)
    entry = next(one for one in report["effects"] if one["name"] == "saturation")
    assert entry["parameters"]["counts"]["value"] == pytest.approx(500.0, rel=0.05)
    low, high = entry["parameters"]["counts"]["ci95"]
    assert low < entry["parameters"]["counts"]["value"] < high


def test_a_silent_board_is_found_by_its_address(write_world, tmp_path):
    def silence_second_board(raw, valid, rng):
        valid = valid.copy()
        valid[:, 1] = False
        return raw, valid

    report = diagnose(*write_world(tmp_path, raw_effect=silence_second_board)).report
    assert report["verdict"]["effects"][0] == "dropout"
    entry = next(one for one in report["effects"] if one["name"] == "dropout")
    assert entry["where"]["sensors"] == [0x21]


def test_an_open_line_is_found_by_its_index(write_world, tmp_path):
    def cut_line(force, signal_counts):
        remaining = signal_counts.copy()
        remaining.reshape(-1, 2, ROWS, COLUMNS)[:, 0, 2] = 0.0
        return remaining

    report = diagnose(*write_world(tmp_path, effect=cut_line, conditions=8)).report
    entry = next(one for one in report["effects"] if one["name"] == "dropout")
    assert report["verdict"]["effects"][0] == "dropout"
    assert entry["where"]["lines"] == [[0x20, "tx", 2]]


def test_additional_noise_is_identified_as_noise(write_world, tmp_path):
    def add_noise(raw, valid, rng):
        return np.rint(raw + rng.normal(0.0, 60.0, raw.shape)), valid

    report = diagnose(*write_world(tmp_path, raw_effect=add_noise)).report
    assert report["verdict"]["effects"] == ["noise"]
    entry = next(one for one in report["effects"] if one["name"] == "noise")
    total = np.hypot(*(entry["parameters"][name]["value"] for name in ("white_counts", "common_counts")))
    assert total == pytest.approx(60.0, rel=0.05)  # the standard deviation of the added noise


def test_an_effect_removed_from_the_catalogue_is_not_named(get_world_paths):
    paths = get_world_paths(effect=add_creep)
    report = diagnose(*paths, without=["hysteresis"]).report
    assert "hysteresis" not in report["verdict"]["effects"]
    assert "hysteresis" not in [entry["name"] for entry in report["effects"]]


def test_an_unknown_effect_cannot_be_removed_from_the_catalogue(get_world_paths):
    with pytest.raises(GapInputError, match="--without: expected one of contact_propagation"):
        diagnose(*get_world_paths(), without=["magic"])


def test_the_report_has_the_documented_schema(get_report, tmp_path):
    report = json.loads(json.dumps(get_report(effect=add_crosstalk), allow_nan=False))
    assert (report["format"], report["version"]) == ("taxel-gap-report", 2)
    assert [entry["name"] for entry in report["effects"]] == list(OWN_EFFECTS)
    for name, rows in report["where"].items():
        share = [row["share"] for row in rows]
        assert share == sorted(share, reverse=True), name
        # Each taxel lies on a TX and on an RX line, so the shares of the lines count it twice.
        assert sum(share) == pytest.approx(2.0 if name == "lines" else 1.0)
        assert all(0.0 <= row["p_value"] <= 1.0 for row in rows)
    assert len(report["where"]["taxels"]) == N
    write_page(report, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text().startswith("<!")


def test_the_same_files_give_the_same_report(get_world_paths, get_report):
    first, second = (
        {name: value for name, value in report.items() if name != "runtime_s"}
        for report in (get_report(effect=add_crosstalk), diagnose(*get_world_paths(effect=add_crosstalk)).report)
    )
    assert first == second


def test_with_fewer_than_three_sessions_the_report_states_that_intervals_are_missing(write_world, tmp_path):
    report = diagnose(*write_world(tmp_path, sessions=2, repeats=3, effect=add_crosstalk)).report
    assert report["gap"]["ci95"] is None
    assert any("2 sessions" in loss for loss in report["losses"])
