"""Sampled effects: from a report within its intervals, or by name within ranges."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.campaign.setup import Setup
from taxel.gap.report.reading import read_report
from taxel.generate.effects import plan_effect, plan_report_effects
from taxel.generate.errors import RecipeError
from taxel.generate.grasping import ShardGenerator
from taxel.generate.ranges import Range
from taxel.generate.recipe_file import add_report
from taxel.generate.sampling import sample_effects
from taxel.grasp.timeline import Phase
from taxel.hand import load_hand

REPORT = Path(__file__).parents[3] / "examples" / "shape_classifier" / "report.json"
HAND = load_hand("original")
SEED = 5


def plan_contact_propagation(share: float = 1.0, **ranges: Range):
    """Plan the effect "contact_propagation" for a share of the grasps. ranges: other ranges of its parameters."""
    defaults = {"spread_mm": Range(1.0, 4.0), "strength": Range(0.2, 0.8)}
    return plan_effect("recipe", "contact_propagation", "", "", share, {**defaults, **ranges}, HAND, 3.5)


def test_effect_changes_the_counts_of_the_hold_but_neither_the_baseline_nor_the_simulated_forces(small_recipe):
    recipe = replace(small_recipe, effects=(plan_contact_propagation(),))
    without_effect = ShardGenerator(small_recipe, 0, Setup()).generate(1).record
    with_effect = ShardGenerator(recipe, 0, Setup()).generate(1)
    record = with_effect.record
    assert np.array_equal(without_effect.contact_force, record.contact_force)
    assert np.array_equal(without_effect.separation, record.separation)
    in_baseline = without_effect.phase == Phase.BASELINE
    assert np.array_equal(without_effect.raw_counts[in_baseline], record.raw_counts[in_baseline])
    signal_gain = without_effect.raw_counts[-1].astype(int) - record.raw_counts[-1]
    is_touched = without_effect.contact_force[-1] > 0.0
    assert signal_gain[is_touched].min() < -30  # touched taxels lose signal
    assert signal_gain[~is_touched].max() > 30  # untouched neighbours gain signal
    assert 1.0 <= with_effect.values["contact_propagation.spread_mm"] <= 4.0


def test_samples_of_a_range_fill_it_and_the_stated_share_of_grasps_has_the_effect(small_recipe):
    recipe = replace(small_recipe, seed=SEED, effects=(plan_contact_propagation(share=0.25),))
    samples = [sample_effects(recipe, number) for number in range(2000)]
    values = np.array([sampled["contact_propagation.spread_mm"] for _, sampled in samples])
    assert (values.min(), values.mean(), values.max()) == pytest.approx((1.0, 2.5, 4.0), abs=0.06), f"seed {SEED}"
    assert np.mean([len(effects) for effects, _ in samples]) == pytest.approx(0.25, abs=0.04), f"seed {SEED}"


def test_samples_of_a_report_have_the_mean_and_the_width_of_its_intervals(small_recipe):
    report = read_report(REPORT)
    recipe = add_report(replace(small_recipe, seed=SEED), REPORT)
    assert [effect.name for effect in recipe.effects] == [effect.name for effect in report.effects]
    reported = next(effect for effect in report.effects if effect.name == "contact_propagation")
    low, high = reported.intervals["spread_mm"]
    values = [sample_effects(recipe, number)[1]["contact_propagation.spread_mm"] for number in range(1000)]
    centre = reported.values[reported.parameters.index("spread_mm"), 0]
    assert np.mean(values) == pytest.approx(centre, abs=0.1 * (high - low)), f"seed {SEED}"
    assert np.percentile(values, [2.5, 97.5]) == pytest.approx(
        [centre - (high - low) / 2, centre + (high - low) / 2], abs=0.15 * (high - low)
    ), f"seed {SEED}"


def test_without_widening_every_grasp_has_the_reported_values():
    report = read_report(REPORT)
    for planned in plan_report_effects(report, HAND, widen=0.0, share=1.0):
        effect, _ = planned.sample(np.random.default_rng(SEED))
        assert effect is not None
        assert np.array_equal(effect.values, planned.nominal.values)


def test_report_of_another_hand_is_refused():
    with pytest.raises(
        RecipeError, match=r"taxels: expected those of the hand 'rig4', found 1037 taxels of another hand"
    ):
        plan_report_effects(read_report(REPORT), load_hand("rig4"), 1.0, 1.0)


@pytest.mark.parametrize(
    ("name", "ranges", "message"),
    [
        ("gravity", {}, "name: expected an effect of the catalogue, found gravity"),
        ("dropout", {}, "name: expected an effect of the catalogue, found dropout"),
        ("saturation", {"volts": Range(0, 1)}, "volts: expected one of counts, found another parameter"),
        (
            "contact_propagation",
            {"strength": Range(0.5, 2.0)},
            "strength: expected a range within 0 to 1 1, found 0.5 to 2",
        ),
    ],
)
def test_invalid_effect_is_refused(name, ranges, message):
    with pytest.raises(RecipeError, match=f"^recipe: {message}"):
        plan_effect("recipe", name, "", "", 1.0, ranges, HAND, 3.5)


def test_effects_of_boards_and_taxels_have_one_value_for_each_and_only_those_of_boards_are_returned():
    for scope, blocks, labels in (("board", 17, 17 + 1), ("taxel", 1037, 1)):  # one label states the presence
        planned = plan_effect("recipe", "gain_mismatch", "", scope, 1.0, {"log_gain": Range(-0.5, 0.5)}, HAND, 3.5)
        effect, sampled = planned.sample(np.random.default_rng(SEED))
        assert effect is not None
        assert len(np.unique(effect.values)) == blocks
        assert len(sampled) == labels
