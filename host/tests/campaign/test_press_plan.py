"""Plans of presses: what a seed decides, what every plan holds, and the rig's hand."""

from __future__ import annotations

import pickle
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from taxel.campaign.press import press_settings, press_timeline, random_press_plan
from taxel.campaign.press.errors import PressError, PressPlanError
from taxel.campaign.press.families import FAMILIES, SIZE_M
from taxel.campaign.press.placing import HARDEST_N, Skin, travel_to
from taxel.campaign.press.settings import poll_hz, scl_for
from taxel.campaign.press.soft_rest import SoftRest
from taxel.campaign.press.standing_layer import StandingLayer
from taxel.campaign.press.stroke import AWAY_M, CLEARANCE_M, LEAST_CLEARANCE_M, Stroke
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.kinematics import kinematics_of
from taxel.recording.grasp_format import BASELINE_FRAMES
from taxel.sim.soft_contact import LayerLaw

SEEDS = (0, 1)


@pytest.fixture(scope="module")
def hand():
    return load_hand("rig4")


@pytest.fixture(scope="module")
def plans(hand):
    return {seed: random_press_plan(hand, seed) for seed in SEEDS}


@pytest.mark.parametrize("seed", SEEDS)
def test_every_session_makes_every_approach_as_often(plans, seed):
    plan = plans[seed]
    assert len(plan.approaches) == 8
    made = Counter((press.session, press.approach.name) for press in plan.presses)
    assert set(made.values()) == {2}
    assert len(made) == 6 * 8
    for approach in plan.approaches:
        own = [press.iteration for press in plan.presses if press.approach is approach]
        assert own == list(range(12))


@pytest.mark.parametrize("seed", SEEDS)
def test_ids_sort_in_order_and_names_tell_nothing(plans, seed):
    plan = plans[seed]
    ids = [press.id for press in plan.presses]
    assert all(one < other for one, other in pairwise(ids))
    assert [approach.name for approach in plan.approaches] == [f"press_{k + 1}" for k in range(8)]
    orders = {tuple(press.approach.name for press in plan.presses[k * 16 : (k + 1) * 16]) for k in range(6)}
    assert len(orders) == 6


@pytest.mark.parametrize("seed", SEEDS)
def test_every_board_is_pressed_twice_and_some_objects_touch_two_boards(plans, seed):
    pressed = Counter(board for approach in plans[seed].approaches for board in approach.boards)
    assert set(pressed) == {"slab", "wall", "dome", "sleeve"}
    assert min(pressed.values()) >= 2
    assert sum(len(approach.boards) == 2 for approach in plans[seed].approaches) == 2
    assert {approach.object for approach in plans[seed].approaches} == set(plans[seed].objects)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_simulator_rests_on_the_boards_that_are_meant(plans, seed, hand):
    plan = plans[seed]
    layer = StandingLayer(hand, plan.bracket_poses, LayerLaw())
    for approach in plan.approaches:
        shape = plan.objects[approach.object].shape
        rest = SoftRest(layer, shape, plan.mount, approach.touch_pose, approach.direction)
        pressed = rest.press(approach.force_n)
        force = rest.taxel_forces(pressed.motion)
        felt = force > 0.15
        assert {hand.boards[board].name for board in hand.board_index[felt]} == set(approach.boards)
        assert 5 <= felt.sum() <= 60
        assert force.max() < 1.2 * HARDEST_N
        assert rest.pose(pressed.motion) == pytest.approx(approach.held_pose, abs=4e-4)
        assert 4.0 <= approach.force_n <= 20.0


@pytest.mark.parametrize("seed", SEEDS)
def test_the_object_just_touches_at_its_touch_pose(plans, seed, hand):
    plan = plans[seed]
    skin = Skin.of(hand, plan.bracket_poses)
    for approach in plan.approaches:
        shape = plan.objects[approach.object].shape
        travel = travel_to(skin, shape, approach.touch_pose, approach.direction)
        assert travel.min() == pytest.approx(0.0, abs=1e-9)
        assert hand.boards[skin.board[np.argmin(travel)]].name in approach.boards


def test_an_object_touches_nothing_on_its_way():
    """With this seed an object that was withdrawn would lie on a board behind it."""
    plan = random_press_plan(load_hand("rig4"), 587127759, approaches=9)
    skin = Skin.of(plan.hand, plan.bracket_poses)
    for approach in plan.approaches:
        pose = approach.touch_pose.copy()
        pose[:3, 3] -= LEAST_CLEARANCE_M * approach.direction
        back = travel_to(skin, plan.objects[approach.object].shape, pose, -approach.direction)
        assert back.min() > AWAY_M + CLEARANCE_M


def test_one_seed_gives_one_plan_and_another_another(hand, plans):
    assert random_press_plan(hand, 0).describe() == plans[0].describe()
    assert len({plan.describe() for plan in plans.values()}) == len(SEEDS)


def test_a_plan_survives_pickling(plans):
    assert pickle.loads(pickle.dumps(plans[0])).describe() == plans[0].describe()


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_draws_solids_of_the_stated_sizes_with_features_on_their_surface(family):
    rng = np.random.default_rng(5)
    for _ in range(5):
        item, features = FAMILIES[family](rng, family)
        extent = np.ptp(item.shape.bounds, axis=0)
        assert extent.max() <= SIZE_M[1] + 1e-9
        assert extent.min() >= SIZE_M[0] - 1e-9
        for feature in features:
            assert np.linalg.norm(feature.outward) == pytest.approx(1.0)
            assert feature.outward @ feature.along == pytest.approx(0.0, abs=1e-9)
            # Of the sharp solid, whose edges are rounded off.
            assert -1e-9 < float(item.shape.signed_distance(feature.middle)) < 0.012


def test_the_rig_has_four_forms_and_two_of_its_boards_form_a_valley(hand):
    assert (hand.n_taxels, [board.name for board in hand.boards]) == (190, ["slab", "wall", "dome", "sleeve"])
    kinematics = kinematics_of(hand)
    normals = kinematics.taxel_normals(np.zeros(1))
    slab, wall, dome, sleeve = (normals[hand.slice_of(board.address)] for board in hand.boards)
    assert np.ptp(slab, axis=0).max() < 1e-9
    assert slab[0] @ wall[0] == pytest.approx(np.cos(np.radians(70.0)), abs=1e-5)
    assert slab[0, 0] > 0 > wall[0, 0]
    assert np.ptp(dome, axis=0).max() > 1.0
    assert np.ptp(sleeve, axis=0)[0] < 1e-9 < np.ptp(sleeve, axis=0)[1]


def test_the_clock_and_the_baseline_fit_the_hand(hand):
    for name, rate in (("rig4", 26.7), ("allegro", 19.5)):
        own = load_hand(name)
        assert poll_hz(own, scl_for(own)) == pytest.approx(rate, abs=0.1)
        assert press_timeline(own).baseline_s * rate > BASELINE_FRAMES + 2
    assert press_settings(hand, seed=5, effects=("spread film length_m=0.002",)).seed == 5


@pytest.mark.parametrize(("touch", "end"), [(0.0, 0.006), (-0.004, -0.002)])
def test_the_mount_comes_in_holds_and_goes_back_the_same_way(touch, end):
    """Also where the touch comes long before it is believed to."""
    stroke = Stroke.through(Timeline(1.0, 1.2, 1.2, 0.8, 0.8), touch, end)
    assert stroke.start_m == pytest.approx(min(-CLEARANCE_M, touch - 0.0005))
    times = np.linspace(0.0, stroke.timeline.duration_s, 501)
    travel, phase = stroke.travel_at(times), stroke.timeline.phase_at(times)
    assert travel[(phase == Phase.BASELINE) | (phase == Phase.RECOVERY)] == pytest.approx(stroke.start_m - AWAY_M)
    assert travel[phase == Phase.HOLD] == pytest.approx(end)
    assert (np.diff(travel[phase == Phase.CLOSING]) >= 0).all()
    assert (np.diff(travel[phase == Phase.RELEASE]) <= 0).all()
    wanted = np.array([-0.02, -0.001 + touch, touch, 0.5 * (touch + end), end])
    going, coming = stroke.times_of(wanted)
    assert stroke.travel_at(going) == pytest.approx(wanted)
    assert stroke.travel_at(coming) == pytest.approx(wanted)
    assert (np.diff(going) > 0).all()
    assert (np.diff(coming) < 0).all()


@pytest.mark.parametrize(
    ("numbers", "field"),
    [
        ({"approaches": 0}, "approaches"),
        ({"approaches": 3}, "approaches"),
        ({"repeats": 0}, "repeats"),
        ({"force_n": (5.0, 4.0)}, "force_n"),
        ({"objects": 0}, "objects"),
    ],
)
def test_numbers_that_make_no_plan_are_refused_in_one_line(hand, numbers, field):
    with pytest.raises(PressPlanError) as caught:
        random_press_plan(hand, 0, **numbers)
    assert str(caught.value).startswith(f"press plan: {field}: expected ")
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_a_press_that_fails_is_named():
    error = PressError("meets no skin").named("s0_03_press_1_0")
    assert str(pickle.loads(pickle.dumps(error))).startswith("press s0_03_press_1_0: the object meets no skin; ")
