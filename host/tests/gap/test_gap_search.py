"""What a diagnosis makes of several causes, and of a cause that is not in its catalogue."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.plugin_package import installed_package
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.identifiability.confounding import confounded_with
from taxel.gap.identifiability.identify import compute_similarities


def harder(force, signal_counts):
    return 2000.0 * force / (force + 1.8 * 1.5)


def clipped(force, signal_counts):
    return np.minimum(signal_counts, 450.0)


def silent_first_board(raw, valid, rng):
    valid = valid.copy()
    valid[:, 0] = False
    return raw, valid


@pytest.fixture(scope="module")
def judge(written):
    return prepared(read_pair(*written(effect=harder)))


def test_an_effect_is_found_besides_a_silent_board(world, tmp_path):
    report = diagnose(*world(tmp_path, sessions=4, effect=clipped, after=silent_first_board)).report
    assert set(report["verdict"]["effects"][:2]) == {"dropout", "saturation"}


def test_a_silent_board_alone_is_reported_only_as_dropout(world, tmp_path):
    report = diagnose(*world(tmp_path, sessions=4, after=silent_first_board)).report
    assert [name for name in report["verdict"]["effects"] if name != "unknown"] == ["dropout"]


def test_a_change_of_amplitude_without_its_effect_in_the_catalogue_is_unknown(world, tmp_path):
    paths = world(tmp_path, sessions=4, effect=harder, most=1.0)
    whole, without = (diagnose(*paths, without=names).report["verdict"] for names in ((), ("stiffness",)))
    named = whole["effects"][0]
    assert "stiffness" in {named, *whole["confounded_with"].get(named, [])}
    # Another effect imitates the change of amplitude in a part; the rest is stated, and an unknown cause is probable.
    assert without["status"] in ("partly_explained", "unknown")
    assert without["probabilities"]["unknown"] > 0.3
    assert "stiffness" not in without["effects"]


PLUGIN = """
from taxel.gap.effects.stiffness import Stiffness

class OtherStiffness(Stiffness):
    name = "my_own"

effects = (OtherStiffness("hand"),)
"""


def test_an_effect_of_another_package_is_named(world, tmp_path):
    folder = tmp_path / "plugin"
    folder.mkdir()
    with installed_package(folder, "my_effect", PLUGIN, {"taxel.effects": {"my_own": "my_effect:effects"}}):
        verdict = diagnose(*world(tmp_path, effect=harder), without=("stiffness", "gain_mismatch")).report["verdict"]
    assert verdict["effects"][0] == "my_own"
    assert "my own" in verdict["one_line"]


def test_a_partly_fitted_out_of_catalogue_cause_is_not_explained(world, tmp_path):
    def swapped(force, signal_counts):
        result = signal_counts.reshape(len(signal_counts), 2, 6, 5).copy()
        result[:, :, 2], result[:, :, 3] = 0.7 * result[:, :, 3], 0.7 * result[:, :, 2]
        return result.reshape(signal_counts.shape)

    report = diagnose(*world(tmp_path, conditions=4, sessions=4, effect=swapped)).report
    assert report["verdict"]["status"] in ("unknown", "partly_explained")
    assert "unknown" in report["verdict"]["effects"]


def test_similarity_is_higher_for_effects_that_produce_similar_changes(judge):
    forms = {name: OWN_EFFECTS[name] for name in ("gain_mismatch", "stiffness", "noise", "latency")}
    rows = {(one.name, one.other): one for one in compute_similarities(judge, forms)}
    assert rows["gain_mismatch", "stiffness"].degrees < rows["gain_mismatch", "latency"].degrees
    assert not rows["gain_mismatch", "noise"].is_confounded
    assert confounded_with(["noise"], {}, list(rows.values())) == {}


def test_a_board_without_a_baseline_is_excluded_from_its_grasp(world, tmp_path):
    spoilt = iter(range(10_000))

    def lossy(raw, valid, rng):
        valid = valid.copy()
        if next(spoilt) == 3:
            valid[:105, 1] = False
        return raw, valid

    report = diagnose(*world(tmp_path, conditions=4, sessions=4, effect=clipped, after=lossy)).report
    assert report["verdict"]["effects"][0] == "saturation"
    assert any("1 of 32 grasps of the hand a board has no baseline" in loss for loss in report["losses"])
