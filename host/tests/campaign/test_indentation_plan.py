"""Plans of indentations: reproducibility, properties of every plan, and the hand of the rig."""

import pickle
from collections import Counter
from itertools import pairwise

import numpy as np
import pytest

from taxel.campaign.indentation import (
    IndentationDesign,
    indentation_settings,
    indentation_timeline,
    sample_indentation_plan,
)
from taxel.campaign.indentation.errors import EquilibriumError, IndentationPlanError
from taxel.campaign.indentation.fixed_layer import FixedSkinLayer
from taxel.campaign.indentation.indenters import FAMILIES, SIZE_M
from taxel.campaign.indentation.placement import (
    LOADED_N,
    MAX_LOADED,
    MAX_TAXEL_FORCE_N,
    MIN_LOADED,
    SkinSurface,
    compute_travel,
)
from taxel.campaign.indentation.settings import choose_scl_frequency, compute_poll_rate
from taxel.campaign.indentation.simulated_equilibrium import SimulatedEquilibrium
from taxel.campaign.indentation.stroke import AWAY_M, CLEARANCE_M, MIN_CLEARANCE_M, Stroke
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.kinematics import build_kinematics
from taxel.recording.grasp_format import BASELINE_FRAMES
from taxel.sim.soft_contact import LayerLaw

SEEDS = (0, 1)
DEFAULT = IndentationDesign()


@pytest.fixture(scope="module")
def hand():
    return load_hand("rig4")


@pytest.fixture(scope="module")
def plans(hand):
    return {seed: sample_indentation_plan(hand, seed) for seed in SEEDS}


@pytest.mark.parametrize("seed", SEEDS)
def test_every_session_repeats_every_approach_equally_often(plans, seed):
    plan = plans[seed]
    assert len(plan.approaches) == DEFAULT.approaches
    repeats = Counter((indentation.session, indentation.approach.name) for indentation in plan.indentations)
    assert set(repeats.values()) == {DEFAULT.repeats}
    assert len(repeats) == DEFAULT.sessions * DEFAULT.approaches
    for approach in plan.approaches:
        iterations = [indentation.iteration for indentation in plan.indentations if indentation.approach is approach]
        assert iterations == list(range(DEFAULT.sessions * DEFAULT.repeats))


@pytest.mark.parametrize("seed", SEEDS)
def test_ids_sort_in_order_of_execution_and_names_reveal_no_board(plans, seed):
    plan = plans[seed]
    ids = [indentation.id for indentation in plan.indentations]
    assert all(first < second for first, second in pairwise(ids))
    assert [approach.name for approach in plan.approaches] == [f"press_{k + 1}" for k in range(DEFAULT.approaches)]


@pytest.mark.parametrize("seed", SEEDS)
def test_every_session_has_its_own_random_order(plans, seed):
    orders = {
        tuple(indentation.approach.name for indentation in plans[seed].indentations if indentation.session == session)
        for session in range(DEFAULT.sessions)
    }
    assert len(orders) == DEFAULT.sessions


@pytest.mark.parametrize("seed", SEEDS)
def test_every_board_is_loaded_at_least_twice_two_approaches_load_two_boards_and_every_object_is_used(plans, seed):
    approaches_of = Counter(board for approach in plans[seed].approaches for board in approach.boards)
    assert set(approaches_of) == {"slab", "wall", "dome", "sleeve"}
    assert min(approaches_of.values()) >= 2
    assert sum(len(approach.boards) == 2 for approach in plans[seed].approaches) == 2
    assert {approach.object for approach in plans[seed].approaches} == set(plans[seed].objects)


@pytest.mark.parametrize("seed", SEEDS)
def test_each_approach_loads_exactly_its_boards_within_the_limits_of_load_and_near_its_held_pose(plans, seed, hand):
    plan = plans[seed]
    layer = FixedSkinLayer(hand, plan.bracket_poses, LayerLaw())
    for approach in plan.approaches:
        shape = plan.objects[approach.object].shape
        equilibrium = SimulatedEquilibrium(layer, shape, plan.mount, approach.touch_pose, approach.direction)
        motion = equilibrium.solve_path(approach.force_n).motion
        force = equilibrium.taxel_forces(motion)
        loaded = force > LOADED_N
        assert {hand.boards[board].name for board in hand.board_index[loaded]} == set(approach.boards)
        assert MIN_LOADED <= loaded.sum() <= MAX_LOADED
        assert force.max() < 1.2 * MAX_TAXEL_FORCE_N  # the plan was checked with coarser springs
        assert equilibrium.pose(motion) == pytest.approx(approach.held_pose, abs=4e-4)
        assert DEFAULT.force_n[0] <= approach.force_n <= DEFAULT.force_n[1]


@pytest.mark.parametrize("seed", SEEDS)
def test_at_the_touch_pose_the_object_just_touches_a_planned_board(plans, seed, hand):
    plan = plans[seed]
    skin = SkinSurface.of(hand, plan.bracket_poses)
    for approach in plan.approaches:
        shape = plan.objects[approach.object].shape
        travel = compute_travel(skin, shape, approach.touch_pose, approach.direction)
        assert travel.min() == pytest.approx(0.0, abs=1e-9)
        assert hand.boards[skin.board[np.argmin(travel)]].name in approach.boards


def test_a_withdrawn_object_touches_no_board_behind_it():
    """Without the check in the placement, an object of this seed would touch a board when it is withdrawn."""
    plan = sample_indentation_plan(load_hand("rig4"), 587127759, IndentationDesign(approaches=9))
    skin = SkinSurface.of(plan.hand, plan.bracket_poses)
    for approach in plan.approaches:
        pose = approach.touch_pose.copy()
        pose[:3, 3] -= MIN_CLEARANCE_M * approach.direction
        travel_back = compute_travel(skin, plan.objects[approach.object].shape, pose, -approach.direction)
        assert travel_back.min() > AWAY_M + CLEARANCE_M


def test_the_seed_determines_the_plan(hand, plans):
    assert sample_indentation_plan(hand, 0).describe() == plans[0].describe()
    assert len({plan.describe() for plan in plans.values()}) == len(SEEDS)


def test_a_plan_can_be_pickled(plans):
    assert pickle.loads(pickle.dumps(plans[0])).describe() == plans[0].describe()


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_samples_solids_of_the_stated_sizes_with_features_on_their_surface(family):
    rng = np.random.default_rng(5)
    for _ in range(5):
        grasp_object, features = FAMILIES[family](rng, family)
        extent = np.ptp(grasp_object.shape.bounds, axis=0)
        assert extent.max() <= SIZE_M[1] + 1e-9
        assert extent.min() >= SIZE_M[0] - 1e-9
        for feature in features:
            assert np.linalg.norm(feature.outward) == pytest.approx(1.0)
            assert feature.outward @ feature.along == pytest.approx(0.0, abs=1e-9)
            # The features belong to the solid without rounding, so they can lie outside the rounded solid.
            assert -1e-9 < float(grasp_object.shape.signed_distance(feature.middle)) < 0.012


def test_the_rig_has_flat_and_curved_boards_and_two_boards_that_form_a_valley(hand):
    assert (hand.n_taxels, [board.name for board in hand.boards]) == (190, ["slab", "wall", "dome", "sleeve"])
    kinematics = build_kinematics(hand)
    normals = kinematics.compute_taxel_normals(np.zeros(1))
    slab, wall, dome, sleeve = (normals[hand.get_slice(board.address)] for board in hand.boards)
    assert np.ptp(slab, axis=0).max() < 1e-9  # flat
    assert slab[0] @ wall[0] == pytest.approx(np.cos(np.radians(70.0)), abs=1e-5)  # inclined towards each other
    assert slab[0, 0] > 0 > wall[0, 0]
    assert np.ptp(dome, axis=0).max() > 1.0  # curved
    assert np.ptp(sleeve, axis=0)[0] < 1e-9 < np.ptp(sleeve, axis=0)[1]  # curved about the x axis only


def test_the_i2c_clock_gives_the_expected_rate_and_the_baseline_has_enough_frames():
    for name, rate_hz in (("rig4", 26.7), ("allegro", 19.5)):  # poll cycles per second
        described_hand = load_hand(name)
        assert compute_poll_rate(described_hand, choose_scl_frequency(described_hand)) == pytest.approx(
            rate_hz, abs=0.1
        )
        assert indentation_timeline(described_hand).baseline_s * rate_hz > BASELINE_FRAMES + 2


def test_indentation_settings_accept_values_of_other_fields(hand):
    settings = indentation_settings(hand, seed=5, effects=("spread film length_m=0.002",))
    assert (settings.seed, settings.effects) == (5, ("spread film length_m=0.002",))


@pytest.mark.parametrize(("touch_m", "end_m"), [(0.0, 0.006), (-0.004, -0.002)])
def test_the_mount_moves_in_holds_and_returns_along_the_same_travel(touch_m, end_m):
    """In the second case the true first contact precedes the nominal one.

    The stroke starts at the clearance before the nominal contact, or 0.5 mm before an earlier true contact.
    """
    stroke = Stroke.through(Timeline(1.0, 1.2, 1.2, 0.8, 0.8), touch_m, end_m)
    assert stroke.start_m == pytest.approx(min(-CLEARANCE_M, touch_m - 0.0005))
    times = np.linspace(0.0, stroke.timeline.duration_s, 501)
    travel, phase = stroke.travel_at(times), stroke.timeline.find_phases(times)
    assert travel[(phase == Phase.BASELINE) | (phase == Phase.RECOVERY)] == pytest.approx(stroke.start_m - AWAY_M)
    assert travel[phase == Phase.HOLD] == pytest.approx(end_m)
    assert (np.diff(travel[phase == Phase.CLOSING]) >= 0).all()
    assert (np.diff(travel[phase == Phase.RELEASE]) <= 0).all()


@pytest.mark.parametrize(("touch_m", "end_m"), [(0.0, 0.006), (-0.004, -0.002)])
def test_the_times_of_a_travel_are_those_at_which_the_mount_passes_it(touch_m, end_m):
    stroke = Stroke.through(Timeline(1.0, 1.2, 1.2, 0.8, 0.8), touch_m, end_m)
    positions = np.array([-0.02, -0.001 + touch_m, touch_m, 0.5 * (touch_m + end_m), end_m])
    inwards, outwards = stroke.times_of(positions)
    assert stroke.travel_at(inwards) == pytest.approx(positions)
    assert stroke.travel_at(outwards) == pytest.approx(positions)
    assert (np.diff(inwards) > 0).all()
    assert (np.diff(outwards) < 0).all()


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
def test_an_infeasible_design_is_rejected_with_a_one_line_message(hand, numbers, field):
    """Three approaches are too few, because each of the four boards needs two."""
    with pytest.raises(IndentationPlanError) as caught:
        sample_indentation_plan(hand, 0, IndentationDesign(**numbers))
    assert str(caught.value).startswith(f"indentation plan: {field}: expected ")
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


def test_the_equilibrium_error_states_the_id_of_the_indentation():
    error = EquilibriumError("meets no skin").for_indentation("s0_03_press_1_0")
    assert str(pickle.loads(pickle.dumps(error))).startswith("indentation s0_03_press_1_0: the object meets no skin; ")
