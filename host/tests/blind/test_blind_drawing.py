"""Which worlds are drawn: kinds in the asked shares, every form of every effect, strengths spread, nobody's choice."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from taxel.blind.drawing import FLOORS, MIX, PRESSES, WITHHELD_EACH, drawn_worlds
from taxel.blind.form import Form
from taxel.blind.hidden import UNKNOWN, Cause, Hidden
from taxel.blind.kinds import INSIDE, NAMES
from taxel.blind.strangers import OUTSIDE
from taxel.campaign.indentation import indentation_settings
from taxel.campaign.session import session_world_text
from taxel.campaign.setup import Setup
from taxel.emulated.contact import SkinContact
from taxel.gap.catalogue import OWN_EFFECTS
from taxel.hand import load_hand

FULL = sum(MIX.values())


@pytest.fixture(scope="module")
def full():
    """The full score's worlds, on the rig."""
    return drawn_worlds(FULL, 0, seed=3)


def hidden_of(worlds, kind):
    return [world.hidden for world in worlds if world.hidden.kind == kind]


def test_kinds_come_in_the_asked_shares(full):
    assert Counter(world.hidden.kind for world in full) == MIX


@pytest.mark.parametrize("count", range(1, 30))
def test_fewer_worlds_keep_the_shares(count):
    kinds = Counter(world.hidden.kind for world in drawn_worlds(count, 0, seed=count))
    assert sum(kinds.values()) == count
    assert all(abs(kinds[kind] - count * number / FULL) <= 2.5 for kind, number in MIX.items())


def test_every_effect_of_the_catalogue_is_hidden_as_often_and_in_all_its_forms(full):
    assert set(NAMES) == set(OWN_EFFECTS)
    causes = [hidden.causes[0] for hidden in hidden_of(full, "single")]
    assert Counter(cause.name for cause in causes) == dict.fromkeys(NAMES, 20)
    forms = Counter(cause.form for cause in causes)
    for name in NAMES:
        own = [forms[form.form] for form in INSIDE if form.name == name]
        assert len(own) >= 2
        assert max(own) - min(own) <= 1


def test_every_cause_outside_the_catalogue_comes_as_often(full):
    forms = Counter(hidden.causes[0].form for hidden in hidden_of(full, "outside"))
    assert set(forms) == {form.form for form in OUTSIDE}
    assert max(forms.values()) - min(forms.values()) <= 1
    assert all(hidden.names == (UNKNOWN,) for hidden in hidden_of(full, "outside"))


def test_pairs_and_triples_hide_different_effects(full):
    several = hidden_of(full, "several")
    assert {len(hidden.causes) for hidden in several} == {2, 3}
    for hidden in several:
        assert len(set(hidden.names)) == len(hidden.causes)
        assert len({line.split()[0] for cause in hidden.causes for line in cause.lines}) == len(hidden.causes)


def test_as_many_of_each_effect_are_withheld_and_as_many_decoys_drawn(full):
    withheld = Counter(world.hidden.names[0] for world in full if world.withheld)
    assert withheld == dict.fromkeys(NAMES, WITHHELD_EACH)
    decoys = [world for world in full if world.decoy]
    assert len(decoys) == sum(withheld.values())
    assert {world.hidden.kind for world in decoys} == set(MIX)
    assert not any(world.withheld or world.decoy in world.hidden.names for world in decoys)


def test_strengths_are_spread_over_each_form(monkeypatch):
    """Drawn without the forms' own words: a form that writes its strength down."""
    noted = Form("noise", "noise white", lambda rng, hand, strength: Cause("noise", "noise white", (f"{strength}",)))
    monkeypatch.setattr("taxel.blind.drawing.forms_of", lambda name: (noted,))
    hidden = hidden_of(drawn_worlds(FULL, 0, seed=4), "single")
    strengths = np.array([float(one.causes[0].lines[0]) for one in hidden])
    low, high = FLOORS
    floors = low * (high / low) ** strengths
    parts = np.floor(20 * (floors - low) / (high - low)).astype(int)
    assert np.bincount(parts).tolist() == [12] * 20  # 12 effects of 20 worlds: each has one in every twentieth


def test_a_stronger_cause_is_never_a_weaker_line():
    hand = load_hand("rig4")
    for form in (*INSIDE, *OUTSIDE):
        weak, strong = (form.draw(np.random.default_rng(7), hand, strength) for strength in (0.0, 1.0))
        assert weak.form == strong.form == form.form
        assert weak.name == form.name
        if form.form not in ("silent from", "line open", "line short", "exchange lines"):  # all or nothing, or a place
            assert weak.lines != strong.lines


def test_nothing_is_hidden_on_boards_that_another_cause_silences(full):
    """Five drawings of sixty pairs and triples each, so that some would be."""
    silenced = 0
    for world in [*full, *(one for seed in range(4) for one in drawn_worlds(FULL, 0, seed=seed))]:
        silent = [cause for cause in world.hidden.causes if cause.form == "silent from"]
        words = {f"board=0x{place.address:02X}" for cause in silent for place in cause.places}
        others = [cause for cause in world.hidden.causes if cause not in silent]
        silenced += bool(silent and others)
        assert not any(all(words & set(line.split()) for line in cause.lines) for cause in others)
        assert not any(
            {one.address for one in cause.places} == {silent[0].places[0].address} for cause in others if silent
        )
    assert silenced > 20


def test_a_board_of_more_gain_still_counts():
    """Beyond, its counter reads 0, and it is a board that does not answer."""
    (form,) = [one for one in INSIDE if one.form == "gain idac"]
    hand = load_hand("rig4")
    causes = [form.draw(np.random.default_rng(seed), hand, 1.0) for seed in range(20)]
    factors = [float(line.split("factor=")[1].split()[0]) for cause in causes for line in cause.lines]
    assert max(factors) == 1.35
    assert min(factors) == pytest.approx(np.exp(-0.6), abs=1e-4)


def test_every_line_is_one_that_the_emulator_takes(full):
    setup = Setup(load_hand("rig4"), {})
    for words in {tuple(line.split()[:2]): line for world in full for line in world.hidden.lines}.values():
        effects = () if words.split()[0].endswith("_offset") else (words,)
        with SkinContact(session_world_text(setup, indentation_settings(setup.hand, effects=effects), 0)):
            pass


def test_the_usual_nuisances_are_on_in_every_world(full):
    for world in full:
        assert [line.split()[:2] for line in world.hidden.nuisances] == [["gain", "electrode"], ["drift", "wander"]]
        assert set(world.hidden.nuisances) < {*world.hidden.lines, ""}


def test_a_spread_of_gains_adds_to_the_nuisance_of_its_form():
    cause = Cause("gain_mismatch", "gain electrode", ("gain electrode log_std=0.3",), (), {"log_std": 0.3})
    other = Cause("gain_mismatch", "gain idac", ("gain idac factor=1.2 board=0x20",), (), {"scale@32": 1.2})
    hidden = Hidden("several", (cause, other), ("gain electrode log_std=0.4", "drift wander counts=1 seconds=60"))
    assert hidden.truth(cause) == {"log_std": pytest.approx(0.5)}
    assert hidden.truth(other) == {"scale@32": 1.2}


def test_plans_are_of_the_asked_size_and_tell_nothing_of_the_kind(full):
    assert all(PRESSES[0] <= world.shape.presses <= PRESSES[1] for world in full)
    assert len({world.shape for world in full}) > 8
    presses = {kind: [w.shape.presses for w in full if w.hidden.kind == kind] for kind in MIX}
    means = [np.mean(own) for own in presses.values()]
    errors = [np.std(own) / np.sqrt(len(own)) for own in presses.values()]
    assert np.ptp(means) < 4 * max(errors)


def test_the_order_and_the_seeds_tell_nothing_of_the_kind(full):
    """Places in the order, and halves and low bits of seeds, against kinds: within what chance leaves (4 sigma)."""
    assert len({world.seed for world in full}) == FULL
    single = np.array([world.hidden.kind == "single" for world in full])
    for flags in (
        np.arange(FULL) < FULL / 2,
        np.array([world.seed >= 2**61 for world in full]),
        np.array([world.seed % 2 == 1 for world in full]),
    ):
        spread = np.sqrt(0.25 * (1 / single.sum() + 1 / (~single).sum()))
        assert abs(flags[single].mean() - flags[~single].mean()) < 4 * spread


def test_seeded_draws_repeat_and_others_do_not():
    assert drawn_worlds(12, 1, seed=5) == drawn_worlds(12, 1, seed=5)
    assert drawn_worlds(12, 0, seed=5) != drawn_worlds(12, 0, seed=6)
    first, second = drawn_worlds(12), drawn_worlds(12)
    assert {world.seed for world in first}.isdisjoint(world.seed for world in second)
    assert [world.hidden for world in first] != [world.hidden for world in second]


def test_the_whole_hand_stands_behind_the_rig():
    worlds = drawn_worlds(5, 2, seed=9)
    assert [world.number for world in worlds] == list(range(7))
    assert [world.hand for world in worlds] == ["rig4"] * 5 + ["allegro"] * 2
    assert {world.shape.approaches for world in worlds[5:]} == {24}


def test_analysis_seeds_are_asked_of_worlds_at_fixed_places(full):
    places = [world.number for world in full if world.repeated]
    assert places[0] == 0
    assert {later - earlier for earlier, later in pairwise(places)} == {40}
