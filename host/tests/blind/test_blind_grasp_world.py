"""The demonstration's world: one hidden cause, and a few grasps that both sides make."""

from __future__ import annotations

from collections import Counter

import pytest

from host.tests.command_line import refusal
from taxel.blind import grasp_world
from taxel.blind.grasp_world import drawn_grasp_world, small_plans
from taxel.blind.seal import commitment


def keys(plan):
    return {(planned.object, planned.approach) for planned in plan}


@pytest.mark.parametrize("seed", range(5))
def test_both_sides_make_two_approaches_of_every_object(seed):
    real, sim = small_plans(seed)
    assert keys(real) == keys(sim)
    assert Counter(item for item, _ in keys(real)) == dict.fromkeys(
        ("cylinder", "rectangular_prism", "triangular_prism"), grasp_world.EACH
    )
    assert Counter((one.object, one.approach, one.session) for one in real).most_common(1)[0][1] == 1
    assert {one.session for one in real} == set(range(grasp_world.SESSIONS))
    assert Counter((one.object, one.approach) for one in sim) == dict.fromkeys(keys(real), grasp_world.REPEATS)
    for plan in (real, sim):
        ids = [one.id for one in plan]
        assert ids == sorted(set(ids))


def test_a_seed_repeats_a_world_and_without_one_no_two_are_the_same():
    assert drawn_grasp_world(4) == drawn_grasp_world(4)
    worlds = [drawn_grasp_world() for _ in range(4)]
    assert len({commitment(world.to_json()) for world in worlds}) == 4


@pytest.mark.parametrize("seed", range(12))
def test_what_is_hidden_acts_on_the_whole_hand(seed):
    (cause,) = drawn_grasp_world(seed).hidden.causes
    assert cause.form in grasp_world.SHOWN
    assert not cause.places


@pytest.mark.parametrize("arguments", [("--seed", "-1"), ("--jobs", "-1")])
def test_impossible_numbers_are_refused_before_anything_is_made(arguments, tmp_path, capsys):
    assert refusal(capsys, "demo", "--out", tmp_path / "demo", *arguments)
    assert not (tmp_path / "demo").exists()
