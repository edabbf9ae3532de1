"""Sampling of worlds: proportions of the kinds, all cause types, strengths, and independence of kind and seed."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from taxel.blind.catalogue_causes import CATALOGUE_CAUSES, EFFECT_NAMES
from taxel.blind.cause_types import CauseType
from taxel.blind.hidden import UNKNOWN, Cause, HiddenCauses
from taxel.blind.out_of_catalogue import OUT_OF_CATALOGUE
from taxel.blind.sampling import FLOORS, INDENTATIONS, KIND_COUNTS, WITHHELD_PER_EFFECT, sample_worlds
from taxel.campaign.indentation import indentation_settings
from taxel.campaign.session_world import format_session_world
from taxel.campaign.setup import Setup
from taxel.emulated.contact import SkinContact
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.hand import load_hand

WORLD_COUNT = sum(KIND_COUNTS.values())


@pytest.fixture(scope="module")
def all_worlds():
    """Sample as many worlds on the rig of four boards as the full score has."""
    return sample_worlds(WORLD_COUNT, 0, seed=3)


def select_hidden(worlds, kind):
    """Return the hidden causes of the worlds of a kind."""
    return [world.hidden for world in worlds if world.hidden.kind == kind]


def test_kinds_have_the_configured_counts(all_worlds):
    assert Counter(world.hidden.kind for world in all_worlds) == KIND_COUNTS


@pytest.mark.parametrize("count", range(1, 30))
def test_fewer_worlds_keep_the_proportions_of_the_kinds_within_two_and_a_half_worlds(count):
    kinds = Counter(world.hidden.kind for world in sample_worlds(count, 0, seed=count))
    assert sum(kinds.values()) == count
    assert all(abs(kinds[kind] - count * number / WORLD_COUNT) <= 2.5 for kind, number in KIND_COUNTS.items())


def test_every_effect_and_every_cause_type_of_the_catalogue_occurs_equally_often(all_worlds):
    assert set(EFFECT_NAMES) == set(OWN_EFFECTS) - {"nonlinearity"}  # an effect that needs data without forces
    causes = [hidden.causes[0] for hidden in select_hidden(all_worlds, "single")]
    assert Counter(cause.name for cause in causes) == dict.fromkeys(EFFECT_NAMES, 20)
    occurrences = Counter(cause.emulator_effect for cause in causes)
    for name in EFFECT_NAMES:
        counts = [occurrences[cause_type.emulator_effect] for cause_type in CATALOGUE_CAUSES if cause_type.name == name]
        assert len(counts) >= 2
        assert max(counts) - min(counts) <= 1


def test_every_out_of_catalogue_cause_occurs_equally_often(all_worlds):
    occurrences = Counter(hidden.causes[0].emulator_effect for hidden in select_hidden(all_worlds, "outside"))
    assert set(occurrences) == {cause_type.emulator_effect for cause_type in OUT_OF_CATALOGUE}
    assert max(occurrences.values()) - min(occurrences.values()) <= 1
    assert all(hidden.names == (UNKNOWN,) for hidden in select_hidden(all_worlds, "outside"))


def test_worlds_with_several_causes_have_two_or_three_causes_of_different_effects(all_worlds):
    several = select_hidden(all_worlds, "several")
    assert {len(hidden.causes) for hidden in several} == {2, 3}
    for hidden in several:
        assert len(set(hidden.names)) == len(hidden.causes)
        # The first word of an effect line names the emulator's effect, such as "gain"; the second is its variant.
        assert len({line.split()[0] for cause in hidden.causes for line in cause.lines}) == len(hidden.causes)


def test_each_effect_is_withheld_from_the_catalogue_equally_often(all_worlds):
    withheld = Counter(world.hidden.names[0] for world in all_worlds if world.is_withheld)
    assert withheld == dict.fromkeys(EFFECT_NAMES, WITHHELD_PER_EFFECT)


def test_as_many_worlds_of_all_kinds_have_a_decoy_that_is_not_hidden_as_worlds_are_withheld(all_worlds):
    """Withheld: a hidden effect is removed from the catalogue. Decoy: an effect that is not hidden is removed, so that
    a removal reveals nothing about the cause.
    """
    decoys = [world for world in all_worlds if world.decoy]
    assert len(decoys) == sum(world.is_withheld for world in all_worlds)
    assert {world.hidden.kind for world in decoys} == set(KIND_COUNTS)
    assert not any(world.is_withheld or world.decoy in world.hidden.names for world in decoys)


def test_strengths_of_sampled_causes_are_spread_evenly_over_the_range_of_gaps(monkeypatch):
    """Of 240 worlds, 12 lie in each of 20 intervals of the intended root of the excess (in floors, from low to high).

    The excess is the squared gap minus the squared floor; the floor is the gap that repeats and sessions cause without
    any effect. The only cause type of this test writes its strength (0 to 1) into its effect line. A strength s
    corresponds to an intended root of low * (high / low)^s.
    """

    def sample(rng, hand, strength):
        return Cause("noise", "noise white", (f"{strength}",))

    cause_type = CauseType("noise", "noise white", sample)
    monkeypatch.setattr("taxel.blind.sampling.list_cause_types", lambda name: (cause_type,))
    hidden = select_hidden(sample_worlds(WORLD_COUNT, 0, seed=4), "single")
    strengths = np.array([float(causes.causes[0].lines[0]) for causes in hidden])
    low, high = FLOORS
    floors = low * (high / low) ** strengths
    strata = np.floor(20 * (floors - low) / (high - low)).astype(int)
    assert np.bincount(strata).tolist() == [12] * 20  # 12 effects with 20 worlds each: one world per stratum


def test_every_cause_type_samples_its_effect_with_parameters_that_depend_on_the_strength():
    hand = load_hand("rig4")
    without_strength = ("silent from", "line open", "line short", "exchange lines")
    for cause_type in (*CATALOGUE_CAUSES, *OUT_OF_CATALOGUE):
        weak, strong = (cause_type.sample(np.random.default_rng(7), hand, strength) for strength in (0.0, 1.0))
        assert weak.emulator_effect == strong.emulator_effect == cause_type.emulator_effect
        assert weak.name == cause_type.name
        if cause_type.emulator_effect not in without_strength:
            assert weak.lines != strong.lines


def test_no_cause_acts_only_on_boards_that_another_cause_silences(all_worlds):
    """Five samples of sixty worlds with several causes contain more than 20 worlds with a silent board."""
    silenced = 0
    for world in [*all_worlds, *(world for seed in range(4) for world in sample_worlds(WORLD_COUNT, 0, seed=seed))]:
        silent = [cause for cause in world.hidden.causes if cause.emulator_effect == "silent from"]
        arguments = {f"board=0x{location.address:02X}" for cause in silent for location in cause.locations}
        others = [cause for cause in world.hidden.causes if cause not in silent]
        silenced += bool(silent and others)
        assert not any(all(arguments & set(line.split()) for line in cause.lines) for cause in others)
        for cause in others if silent else ():
            assert {location.address for location in cause.locations} != {silent[0].locations[0].address}
    assert silenced > 20


def test_gain_factor_of_a_board_is_at_most_1_35_and_at_least_0_55_at_full_strength():
    """Above a factor of 1.35, the counter saturates and reads 0, as if the board did not respond. 0.55 is exp(-0.6)."""
    (cause_type,) = [cause_type for cause_type in CATALOGUE_CAUSES if cause_type.emulator_effect == "gain idac"]
    hand = load_hand("rig4")
    causes = [cause_type.sample(np.random.default_rng(seed), hand, 1.0) for seed in range(20)]
    factors = [float(line.split("factor=")[1].split()[0]) for cause in causes for line in cause.lines]
    assert max(factors) == 1.35
    assert min(factors) == pytest.approx(np.exp(-0.6), abs=1e-4)


def test_emulator_accepts_every_effect_line(all_worlds):
    setup = Setup(load_hand("rig4"), {})
    for line in {tuple(line.split()[:2]): line for world in all_worlds for line in world.hidden.lines}.values():
        effects = () if line.split()[0].endswith("_offset") else (line,)
        with SkinContact(format_session_world(setup, indentation_settings(setup.hand, effects=effects), 0)):
            pass


def test_every_world_has_the_same_kinds_of_nuisances(all_worlds):
    for world in all_worlds:
        assert [line.split()[:2] for line in world.hidden.nuisances] == [["gain", "electrode"], ["drift", "wander"]]
        assert set(world.hidden.nuisances) < {*world.hidden.lines, ""}


def test_true_gain_variation_includes_the_variance_of_the_nuisance_of_the_same_emulator_effect():
    """The variances of cause and nuisance (a deviation that is no cause) add up: sqrt(0.3^2 + 0.4^2) = 0.5."""
    cause = Cause("gain_mismatch", "gain electrode", ("gain electrode log_std=0.3",), (), {"log_std": 0.3})
    board_gain = Cause("gain_mismatch", "gain idac", ("gain idac factor=1.2 board=0x20",), (), {"scale@32": 1.2})
    hidden = HiddenCauses(
        "several", (cause, board_gain), ("gain electrode log_std=0.4", "drift wander counts=1 seconds=60")
    )
    assert hidden.true_parameters(cause) == {"log_std": pytest.approx(0.5)}
    assert hidden.true_parameters(board_gain) == {"scale@32": 1.2}


def test_campaign_sizes_vary_within_their_limits(all_worlds):
    assert all(INDENTATIONS[0] <= world.size.indentations <= INDENTATIONS[1] for world in all_worlds)
    assert len({world.size for world in all_worlds}) > 8


def test_mean_number_of_indentations_does_not_depend_on_the_kind_of_world(all_worlds):
    counts = [[world.size.indentations for world in all_worlds if world.hidden.kind == kind] for kind in KIND_COUNTS]
    means = [np.mean(of_kind) for of_kind in counts]
    errors = [np.std(of_kind) / np.sqrt(len(of_kind)) for of_kind in counts]
    assert np.ptp(means) < 4 * max(errors)


def test_order_and_seeds_do_not_depend_on_the_kind_of_world(all_worlds):
    """Worlds with a single cause are compared with all other worlds by three shares.

    These are the shares of worlds in the first half of the order, with a seed in the upper half of its range, and with
    an odd seed. They differ by less than 4 standard errors.
    """
    assert len({world.seed for world in all_worlds}) == WORLD_COUNT
    single = np.array([world.hidden.kind == "single" for world in all_worlds])
    for flags in (
        np.arange(WORLD_COUNT) < WORLD_COUNT / 2,
        np.array([world.seed >= 2**61 for world in all_worlds]),
        np.array([world.seed % 2 == 1 for world in all_worlds]),
    ):
        standard_error = np.sqrt(0.25 * (1 / single.sum() + 1 / (~single).sum()))
        assert abs(flags[single].mean() - flags[~single].mean()) < 4 * standard_error


def test_worlds_are_determined_by_the_seed():
    assert sample_worlds(12, 1, seed=5) == sample_worlds(12, 1, seed=5)
    assert sample_worlds(12, 0, seed=5) != sample_worlds(12, 0, seed=6)


def test_worlds_without_a_seed_differ_between_two_samples():
    first_sample, second_sample = sample_worlds(12), sample_worlds(12)
    assert {world.seed for world in first_sample}.isdisjoint(world.seed for world in second_sample)
    assert [world.hidden for world in first_sample] != [world.hidden for world in second_sample]


def test_worlds_of_the_whole_hand_follow_those_of_the_rig():
    worlds = sample_worlds(5, 2, seed=9)
    assert [world.number for world in worlds] == list(range(7))
    assert [world.hand for world in worlds] == ["rig4"] * 5 + ["original"] * 2
    assert {world.size.approaches for world in worlds[5:]} == {24}  # of every campaign with the whole hand


def test_every_fortieth_world_is_diagnosed_with_further_analysis_seeds(all_worlds):
    numbers = [world.number for world in all_worlds if world.is_repeated]
    assert numbers[0] == 0
    assert {later - earlier for earlier, later in pairwise(numbers)} == {40}
