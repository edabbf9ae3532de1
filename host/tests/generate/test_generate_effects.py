"""Effects that are drawn: from a report within its intervals, by name within ranges, and nothing else is changed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.campaign.setup import Setup
from taxel.gap.report.reading import read_report
from taxel.generate.draws import draw_effects
from taxel.generate.effects import planned_by_name, planned_of_report
from taxel.generate.errors import RecipeError
from taxel.generate.grasping import ShardMaker
from taxel.generate.ranges import Range
from taxel.generate.recipe_file import with_report
from taxel.grasp.timeline import Phase
from taxel.hand import load_hand

REPORT = Path(__file__).parents[3] / "examples" / "shape_classifier" / "report.json"
HAND = load_hand("allegro")
SEED = 5


def spread(share: float = 1.0, **ranges: Range):
    """Contact propagation by name."""
    known = {"spread_mm": Range(1.0, 4.0), "strength": Range(0.2, 0.8)}
    return planned_by_name("recipe", "contact_propagation", "", "", share, {**known, **ranges}, HAND, 3.5)


def test_an_effect_changes_counts_from_closing_on_and_neither_motion_nor_noise(whole):
    recipe = replace(whole.recipe, effects=(spread(),))
    plain = ShardMaker(whole.recipe, 0, Setup()).make(1).record
    added = ShardMaker(recipe, 0, Setup()).make(1)
    record = added.record
    assert np.array_equal(plain.contact_force, record.contact_force)
    assert np.array_equal(plain.separation, record.separation)
    before = plain.phase == Phase.BASELINE
    assert np.array_equal(plain.raw_counts[before], record.raw_counts[before])
    change = plain.raw_counts.astype(int) - record.raw_counts
    touched = plain.contact_force[-1] > 0.0
    assert change[-1][touched].min() < -30  # what is pressed gives away
    assert change[-1][~touched].max() > 30  # to what is not
    assert 1.0 <= added.values["contact_propagation.spread_mm"] <= 4.0


def test_draws_by_name_fill_their_range_and_a_share_of_grasps_has_the_effect(whole):
    recipe = replace(whole.recipe, seed=SEED, effects=(spread(share=0.25),))
    drawn = [draw_effects(recipe, number) for number in range(2000)]
    values = np.array([told["contact_propagation.spread_mm"] for _, told in drawn])
    assert (values.min(), values.mean(), values.max()) == pytest.approx((1.0, 2.5, 4.0), abs=0.06), f"seed {SEED}"
    assert np.mean([len(effects) for effects, _ in drawn]) == pytest.approx(0.25, abs=0.04), f"seed {SEED}"


def test_draws_of_a_report_have_the_mean_and_the_width_of_its_intervals(whole):
    report = read_report(REPORT)
    recipe = with_report(replace(whole.recipe, seed=SEED), REPORT)
    assert [one.name for one in recipe.effects] == [one.name for one in report.effects]
    found = next(one for one in report.effects if one.name == "contact_propagation")
    low, high = found.intervals["spread_mm"]
    told = [draw_effects(recipe, number)[1]["contact_propagation.spread_mm"] for number in range(1000)]
    middle = found.values[found.parameters.index("spread_mm"), 0]
    assert np.mean(told) == pytest.approx(middle, abs=0.1 * (high - low)), f"seed {SEED}"
    assert np.percentile(told, [2.5, 97.5]) == pytest.approx(
        [middle - (high - low) / 2, middle + (high - low) / 2], abs=0.15 * (high - low)
    ), f"seed {SEED}"


def test_without_widening_every_grasp_has_the_values_that_were_found():
    report = read_report(REPORT)
    for planned in planned_of_report(report, HAND, widen=0.0, share=1.0):
        one, _ = planned.draw(np.random.default_rng(SEED))
        assert one is not None
        assert np.array_equal(one.values, planned.found.values)


def test_a_report_of_another_hand_is_refused():
    with pytest.raises(
        RecipeError, match=r"taxels: expected those of the hand 'rig4', found 1073 taxels of another hand"
    ):
        planned_of_report(read_report(REPORT), load_hand("rig4"), 1.0, 1.0)


@pytest.mark.parametrize(
    ("name", "ranges", "complaint"),
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
def test_a_mistake_is_named(name, ranges, complaint):
    with pytest.raises(RecipeError, match=f"^recipe: {complaint}"):
        planned_by_name("recipe", name, "", "", 1.0, ranges, HAND, 3.5)


def test_effects_of_boards_and_taxels_have_a_draw_for_each():
    for scope, blocks in (("board", 17), ("taxel", 1073)):
        planned = planned_by_name("recipe", "gain_mismatch", "", scope, 1.0, {"log_gain": Range(-0.5, 0.5)}, HAND, 3.5)
        one, told = planned.draw(np.random.default_rng(SEED))
        assert one is not None
        assert len(np.unique(one.values)) == blocks
        assert len(told) == (18 if scope == "board" else 1)
