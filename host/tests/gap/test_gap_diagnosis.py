"""The diagnosis of small worlds whose effect is known, and of those without one."""

from __future__ import annotations

import json

import numpy as np
import pytest

from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.errors import GapInputError
from taxel.gap.page import write_page

ROWS, COLUMNS, N = 6, 5, 60


def on_line(signal_counts: np.ndarray, axis: int) -> np.ndarray:
    """Mean drop of the other taxels on the line."""
    grid = signal_counts.reshape(-1, 2, ROWS, COLUMNS)
    count = grid.shape[3 - axis]
    total = grid.sum(axis=3 - axis, keepdims=True)
    return ((total - grid) / (count - 1)).reshape(signal_counts.shape)


def crosstalk(force, signal_counts):
    return signal_counts + 0.15 * on_line(signal_counts, 0) + 0.25 * on_line(signal_counts, 1)


def clipped(force, signal_counts):
    return np.minimum(signal_counts, 500.0)


def harder(force, signal_counts):
    return 2000.0 * force / (force + 1.5 * 1.8)


def creeping(force, signal_counts):
    late = np.zeros_like(signal_counts)
    for k in range(1, len(signal_counts)):
        late[k] = late[k - 1] + (1 - np.exp(-0.05 / 0.5)) * (signal_counts[k] - late[k - 1])
    return 0.6 * signal_counts + 0.4 * late


def board_late(force, signal_counts):
    late = signal_counts.copy()
    late[4:, : N // 2] = signal_counts[:-4, : N // 2]
    return late


def spread(force, signal_counts):
    x, y = np.arange(ROWS)[:, None], np.arange(COLUMNS)
    places = np.stack([np.repeat(x, COLUMNS, axis=1).ravel(), np.tile(y, ROWS)], axis=1) * 5.0
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    kernel = np.exp(-apart / 3.0)
    kernel /= kernel.sum(axis=1, keepdims=True)
    moved = np.concatenate([part @ kernel for part in np.split(force, 2, axis=1)], axis=1)
    return 2000.0 * moved / (moved + 1.5)


EFFECTS = {
    "electrode_crosstalk": crosstalk,
    "saturation": clipped,
    "stiffness": harder,
    "hysteresis": creeping,
    "latency": board_late,
    "contact_propagation": spread,
}


def test_without_an_effect_there_is_no_gap(reported):
    report = reported()
    assert report["verdict"]["status"] == "no_gap"
    assert report["verdict"]["effects"] == []
    assert report["gap"]["value"] < 2.0 * report["gap"]["floor"]


@pytest.mark.parametrize("name", EFFECTS)
def test_the_applied_effect_is_named_first(reported, name):
    report = reported(effect=EFFECTS[name])
    assert report["gap"]["significant"]
    assert report["verdict"]["effects"][0] == name
    assert abs(report["after"]["predicted_shrink"] - report["after"]["shrink"]) < 0.05
    entry = next(one for one in report["effects"] if one["name"] == name)
    assert 0.0 < entry["measured_shrink"] == pytest.approx(entry["predicted_shrink"], abs=0.05)


def test_the_applied_parameters_are_recovered(reported):
    report = reported(effect=clipped)
    entry = next(one for one in report["effects"] if one["name"] == "saturation")
    assert entry["parameters"]["counts"]["value"] == pytest.approx(500.0, rel=0.05)
    low, high = entry["parameters"]["counts"]["ci95"]
    assert low < entry["parameters"]["counts"]["value"] < high


def test_a_silent_board_is_found_by_its_address(world, tmp_path):
    def silence(raw, valid, rng):
        valid = valid.copy()
        valid[:, 1] = False
        return raw, valid

    report = diagnose(*world(tmp_path, after=silence)).report
    assert report["verdict"]["effects"][0] == "dropout"
    entry = next(one for one in report["effects"] if one["name"] == "dropout")
    assert entry["where"]["sensors"] == [0x21]


def test_an_open_line_is_found_by_its_index(world, tmp_path):
    def cut(force, signal_counts):
        left = signal_counts.copy()
        left.reshape(-1, 2, ROWS, COLUMNS)[:, 0, 2] = 0.0
        return left

    report = diagnose(*world(tmp_path, effect=cut, conditions=8)).report
    entry = next(one for one in report["effects"] if one["name"] == "dropout")
    assert report["verdict"]["effects"][0] == "dropout"
    assert entry["where"]["lines"] == [[0x20, "tx", 2]]


def test_additional_noise_is_identified_as_noise(world, tmp_path):
    def noisy(raw, valid, rng):
        return np.rint(raw + rng.normal(0.0, 60.0, raw.shape)), valid

    report = diagnose(*world(tmp_path, after=noisy)).report
    assert report["verdict"]["effects"] == ["noise"]
    entry = next(one for one in report["effects"] if one["name"] == "noise")
    total = np.hypot(*(entry["parameters"][name]["value"] for name in ("white_counts", "common_counts")))
    assert total == pytest.approx(60.0, rel=0.05)


def test_an_effect_removed_from_the_catalogue_is_not_named(written):
    paths = written(effect=creeping)
    report = diagnose(*paths, without=["hysteresis"]).report
    assert "hysteresis" not in report["verdict"]["effects"]
    assert "hysteresis" not in [entry["name"] for entry in report["effects"]]
    with pytest.raises(GapInputError, match="--without: expected one of contact_propagation"):
        diagnose(*paths, without=["magic"])


def test_the_report_has_the_documented_schema(reported, tmp_path):
    report = json.loads(json.dumps(reported(effect=crosstalk), allow_nan=False))
    assert (report["format"], report["version"]) == ("taxel-gap-report", 2)
    assert [entry["name"] for entry in report["effects"]] == list(OWN_EFFECTS)
    for name, rows in report["where"].items():
        share = [row["share"] for row in rows]
        assert share == sorted(share, reverse=True), name
        assert sum(share) == pytest.approx(2.0 if name == "lines" else 1.0)
        assert all(0.0 <= row["p_value"] <= 1.0 for row in rows)
    assert len(report["where"]["taxels"]) == N
    write_page(report, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text().startswith("<!")


def test_the_same_files_give_the_same_report(written, reported):
    first, second = (
        {name: value for name, value in report.items() if name != "runtime_s"}
        for report in (reported(effect=crosstalk), diagnose(*written(effect=crosstalk)).report)
    )
    assert first == second


def test_with_fewer_than_three_sessions_the_report_states_that_intervals_are_missing(world, tmp_path):
    report = diagnose(*world(tmp_path, sessions=2, repeats=3, effect=crosstalk)).report
    assert report["gap"]["ci95"] is None
    assert any("2 sessions" in loss for loss in report["losses"])
