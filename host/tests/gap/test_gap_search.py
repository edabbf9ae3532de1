"""Diagnosis of several causes, and of a cause outside the catalogue."""

from __future__ import annotations

import numpy as np

from host.tests.gap.stiffer_layer import stiffen
from host.tests.plugin_package import installed_package
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.identifiability.confounding import find_confounded_effects
from taxel.gap.identifiability.identify import compute_similarities


def clip_signal(force, signal_counts):
    return np.minimum(signal_counts, 450.0)


def silence_first_board(raw, valid, rng):
    """Mark all frames of the first board as lost."""
    valid = valid.copy()
    valid[:, 0] = False
    return raw, valid


def test_a_saturation_is_found_beside_a_silent_board(write_world, tmp_path):
    report = diagnose(*write_world(tmp_path, sessions=4, effect=clip_signal, raw_effect=silence_first_board)).report
    assert set(report["verdict"]["effects"][:2]) == {"dropout", "saturation"}


def test_a_silent_board_alone_is_reported_only_as_dropout(write_world, tmp_path):
    report = diagnose(*write_world(tmp_path, sessions=4, raw_effect=silence_first_board)).report
    assert [name for name in report["verdict"]["effects"] if name != "unknown"] == ["dropout"]


def test_a_change_of_amplitude_without_its_effect_in_the_catalogue_is_unknown(write_world, tmp_path):
    paths = write_world(tmp_path, sessions=4, effect=stiffen, largest_force_n=1.0)
    whole, without = (diagnose(*paths, without=names).report["verdict"] for names in ((), ("stiffness",)))
    named = whole["effects"][0]
    assert "stiffness" in {named, *whole["confounded_with"].get(named, [])}
    # Another effect fits a part of the change of amplitude; the rest makes an unknown cause probable.
    assert without["status"] in ("partly_explained", "unknown")
    assert without["probabilities"]["unknown"] > 0.3
    assert "stiffness" not in without["effects"]


PLUGIN = """
from taxel.gap.effects.stiffness import Stiffness

class OtherStiffness(Stiffness):
    name = "my_own"

effects = (OtherStiffness("hand"),)
"""


def test_an_effect_of_another_package_is_named(write_world, tmp_path):
    folder = tmp_path / "plugin"
    folder.mkdir()
    with installed_package(folder, "my_effect", PLUGIN, {"taxel.effects": {"my_own": "my_effect:effects"}}):
        verdict = diagnose(*write_world(tmp_path, effect=stiffen), without=("stiffness", "gain_mismatch")).report[
            "verdict"
        ]
    assert verdict["effects"][0] == "my_own"
    assert "my own" in verdict["one_line"]


def test_a_partly_fitted_out_of_catalogue_cause_is_not_explained(write_world, tmp_path):
    def exchange_and_weaken_lines(force, signal_counts):
        result = signal_counts.reshape(len(signal_counts), 2, 6, 5).copy()
        result[:, :, 2], result[:, :, 3] = 0.7 * result[:, :, 3], 0.7 * result[:, :, 2]
        return result.reshape(signal_counts.shape)

    report = diagnose(*write_world(tmp_path, conditions=4, sessions=4, effect=exchange_and_weaken_lines)).report
    assert report["verdict"]["status"] in ("unknown", "partly_explained")
    assert "unknown" in report["verdict"]["effects"]


def test_the_angle_between_gain_and_stiffness_is_smaller_than_between_gain_and_latency(fit_data):
    forms = {name: OWN_EFFECTS[name] for name in ("gain_mismatch", "stiffness", "noise", "latency")}
    rows = {(one.name, one.other): one for one in compute_similarities(fit_data, forms)}
    assert rows["gain_mismatch", "stiffness"].angle_deg < rows["gain_mismatch", "latency"].angle_deg
    assert not rows["gain_mismatch", "noise"].is_confounded
    assert find_confounded_effects(["noise"], {}, list(rows.values())) == {}


def test_a_board_without_a_baseline_is_excluded_from_its_grasp(write_world, tmp_path):
    grasp_numbers = iter(range(10_000))

    def remove_one_baseline(raw, valid, rng):
        valid = valid.copy()
        if next(grasp_numbers) == 3:
            valid[:105, 1] = False  # the frames of the baseline, second board
        return raw, valid

    report = diagnose(
        *write_world(tmp_path, conditions=4, sessions=4, effect=clip_signal, raw_effect=remove_one_baseline)
    ).report
    assert report["verdict"]["effects"][0] == "saturation"
    assert any("1 of 32 grasps of the hand a board has no baseline" in loss for loss in report["losses"])
