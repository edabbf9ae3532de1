"""The contact plug-in of the original simulator: each rule, and all rules against a plain re-computation."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taxel.grasp.objects import make_thesis_objects
from taxel.grasp.plan import PALM_PLACEMENTS, make_approach
from taxel.grasp.timeline import Phase, Timeline
from taxel.hand import load_hand
from taxel.hand.original.centres import NoCodedCentresError, load_coded_centres
from taxel.hand.transforms import apply, inverse
from taxel.sim.closing import SimulationSettings, simulate_grasp
from taxel.sim.contact_messages import FIRST_OTHER, OBJECT, ContactMessage, PairEntry, RecorderSettings
from taxel.sim.original_sensing import (
    OVERLAP_M,
    PAD_M,
    PALM_TIPS_M,
    THRESHOLD_HISTORY_M,
    ContactMemory,
    OriginalRules,
    StoredPoints,
    find_active,
    find_pad_corners,
    get_centres,
    get_surface_heights,
    make_recorder_settings,
    sense_messages,
)
from taxel.sim.scene import build_scene
from taxel.sim.sensing import Sensing, sense
from taxel.sim.soft_contact import LayerLaw

ROOT = Path(__file__).parents[3]
ORIGINAL = load_hand("original")
SMALL = load_hand("flat8")
SEVERAL = load_hand("rig4")
GENERAL = OriginalRules(coded_centres=False, boards_without_coordinates=False)
"""Rules that apply to every hand."""
CYLINDER = make_thesis_objects()["cylinder"]


def make_entry(bodies, *points, force=1.0):
    """Make an entry of a contact message whose points all have the same force, newtons."""
    return PairEntry(bodies, np.array(points, dtype=float).reshape(-1, 3), np.full(len(points), force))


def test_the_packaged_coded_centres_agree_with_the_tool_that_extracts_them():
    script = ROOT / "tools/hand/original_coded_centres.py"
    result = subprocess.run([sys.executable, script, "--check"], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(
    ("kind", "mean_mm", "max_mm"),
    [("proximal_front", 2.29, 3.03), ("medial_front", 2.14, 3.25), ("fingertip", 2.88, 4.77), ("palm", 0.05, 5.72)],
)
def test_coded_centres_have_the_extracted_distance_from_the_true_centres(kind, mean_mm, max_mm):
    """The original programs contain taxel centres as numbers, which differ from the true centres by some mm."""
    distance = 1e3 * np.linalg.norm(load_coded_centres(ORIGINAL) - ORIGINAL.position, axis=1)
    is_kind = np.concatenate([np.full(board.kind.taxel_count, board.kind.name == kind) for board in ORIGINAL.boards])
    assert distance[is_kind].mean() == pytest.approx(mean_mm, abs=0.006)
    assert distance[is_kind].max() == pytest.approx(max_mm, abs=0.006)


def test_463_taxels_have_coordinates_and_the_backs_of_the_fingers_lie_at_their_brackets():
    """The original plug-in has coordinates of 463 taxels (docs/original-simulator.md).

    Taxels on the backs of the fingers lie at the origin of their bracket. The taxels of three boards have no
    coordinates (NaN). Without the rule `boards_without_coordinates`, every taxel has a centre.
    """
    centres = get_centres(ORIGINAL, OriginalRules())
    is_at_origin = (centres == 0).all(axis=1)
    by_board = {board.name: centres[ORIGINAL.get_slice(board.address)] for board in ORIGINAL.boards}
    assert np.isfinite(centres).all(axis=1).sum() - is_at_origin.sum() == 463
    for name, values in by_board.items():
        if name in {"back_of_hand", "fingertip_middle", "fingertip_pinkie"}:
            assert np.isnan(values).all()
        else:
            assert (values == 0).all() == ("_back_" in name)
    every = get_centres(ORIGINAL, replace(OriginalRules(), boards_without_coordinates=False))
    assert np.isfinite(every).all()
    np.testing.assert_array_equal(get_centres(ORIGINAL, GENERAL), ORIGINAL.position)


@pytest.mark.parametrize(
    "rules", [replace(GENERAL, coded_centres=True), replace(GENERAL, boards_without_coordinates=True)]
)
def test_rules_of_the_original_hand_are_refused_for_another_hand(rules):
    with pytest.raises(NoCodedCentresError, match="'flat8': expected original") as caught:
        get_centres(SMALL, rules)
    assert "\n" not in str(caught.value)


def test_the_threshold_is_strict_and_the_final_one_is_the_default():
    assert OriginalRules().threshold_m == THRESHOLD_HISTORY_M["final"] == 0.00234
    at_distance = [0.25, np.nextafter(0.25, 0.0), np.nextafter(0.25, 1.0)]  # exact in binary
    points = StoredPoints(np.zeros((1, 3)), np.ones(1))
    centres = np.array([[0.0, distance, 0.0] for distance in at_distance])
    assert find_active(centres, points, 0.25)[0].tolist() == [False, True, False]


def test_a_taxel_is_active_once_with_the_largest_force_of_the_near_points():
    points = StoredPoints(np.array([[0.0, 0, 0], [0.001, 0, 0], [0.1, 0, 0]]), np.array([1.0, 3.0, 9.0]))
    active, force = find_active(np.array([[0.0, 0, 0], [0.05, 0, 0]]), points, threshold_m=0.002)
    assert active.tolist() == [True, False]
    assert force.tolist() == [3.0, 0.0]


def test_of_taxels_at_one_position_only_the_first_is_active():
    points = StoredPoints(np.zeros((1, 3)), np.ones(1))
    active, _ = find_active(np.array([[np.nan] * 3, [0.0] * 3, [0.0] * 3, [0.0] * 3]), points, 0.002)
    assert active.tolist() == [False, True, False, False]


@pytest.mark.parametrize("stale", [True, False])
def test_contact_points_are_kept_after_an_empty_message_unless_the_rule_is_off(stale):
    """In the original program, a message without contacts does not delete the points of the message before."""
    memory = ContactMemory(replace(GENERAL, stale_contacts=stale))
    memory.receive(ContactMessage(0.2, 0, (make_entry((0, OBJECT), [0, 0, 1]),)))
    memory.receive(ContactMessage(0.4, 0, ()))
    assert len(memory.get_points(0).position) == stale
    memory.receive(ContactMessage(0.6, 0, (make_entry((0, OBJECT), [0, 0, 2], [0, 0, 3]),)))
    assert memory.get_points(0).position[:, 2].tolist() == [2, 3]


def test_only_the_first_entry_of_a_pair_counts_in_either_order_of_its_bodies():
    """The original program ignores further entries of the same two bodies (rule `first_entry_only`)."""
    entries = (make_entry((0, OBJECT), [0, 0, 1]), make_entry((OBJECT, 0), [0, 0, 2]))
    for only_first, heights in ((True, [1]), (False, [1, 2])):
        memory = ContactMemory(replace(GENERAL, first_entry_only=only_first))
        memory.receive(ContactMessage(0.2, 0, entries))
        assert memory.get_points(0).position[:, 2].tolist() == heights


def test_contacts_with_the_hand_itself_count_unless_the_rule_is_off():
    """The original program does not check with which body a board is in contact (rule `any_partner`)."""
    entries = (make_entry((FIRST_OTHER - 3, 0), [0, 0, 1]), make_entry((0, OBJECT), [0, 0, 2]))
    for any_partner, heights in ((True, [1, 2]), (False, [2])):
        memory = ContactMemory(replace(GENERAL, any_partner=any_partner))
        memory.receive(ContactMessage(0.2, 0, entries))
        assert memory.get_points(0).position[:, 2].tolist() == heights


def test_a_message_is_stored_under_the_name_of_its_last_pair():
    """In the original program, all points of a message belong to the board of its last pair (rule `last_name_wins`)."""
    entries = (make_entry((0, OBJECT), [0, 0, 1]), make_entry((1, 0), [0, 0, 2]))
    for last_name, board in ((True, 1), (False, 0)):
        memory = ContactMemory(replace(GENERAL, last_name_wins=last_name))
        memory.receive(ContactMessage(0.2, 0, entries))
        assert memory.get_points(board).position[:, 2].tolist() == [1, 2]
        assert len(memory.get_points(1 - board).position) == 0


def recompute_plainly(hand, poses, times, messages, rules):
    """Recompute the plug-in with lists and loops, as in its source: for each sample, forces by active taxel."""
    centres, results = get_centres(hand, rules), []
    for sample, time in enumerate(times):
        kept = {}
        for message in messages:
            if message.time_s > time:
                break
            points, pairs, name = [], [], message.board
            for entry in message.entries:
                first, second = entry.bodies
                if not rules.any_partner and OBJECT not in (first, second):
                    continue
                if rules.first_entry_only and ((first, second) in pairs or (second, first) in pairs):
                    continue
                pairs.append((first, second))
                if rules.last_name_wins:
                    name = first if first >= 0 else second
                points += list(zip(entry.position, entry.force_n, strict=True))
            if points:
                kept[name] = points
            elif not rules.stale_contacts:
                kept.pop(message.board, None)
        forces, seen = {}, set()
        for taxel in range(hand.n_taxels):
            board = int(hand.board_index[taxel])
            if not np.isfinite(centres[taxel]).all() or (board, *centres[taxel]) in seen:
                continue
            seen.add((board, *centres[taxel]))
            pose = poses[sample, board]
            centre = pose[:3, :3] @ centres[taxel] + pose[:3, 3]
            near = [f for p, f in kept.get(board, []) if np.sqrt(((p - centre) ** 2).sum()) < rules.threshold_m]
            if near:
                forces[taxel] = max(near)
        results.append(forces)
    return results


def make_random_messages(hand, rng, periods):
    """Make random messages of all boards: points near taxels, repeated pairs, contacts in the hand, empty messages."""
    messages = []
    centres = get_centres(hand, OriginalRules() if hand is ORIGINAL else GENERAL)
    for period in range(periods):
        for index, board in enumerate(hand.boards):
            entries = []
            for _ in range(rng.integers(0, 4)):
                other = OBJECT if rng.random() < 0.5 else int(rng.choice([FIRST_OTHER, *range(len(hand.boards))]))
                pair = (index, other) if rng.random() < 0.5 else (other, index)
                near = np.nan_to_num(centres[hand.get_slice(board.address)])
                points = rng.choice(near, rng.integers(1, 5)) + rng.normal(scale=0.001, size=(1, 3))
                entries.append(PairEntry(pair, points, rng.uniform(0.0, 2.0, len(points))))
            messages.append(ContactMessage(0.2 * (period + 1), index, tuple(entries)))
    return messages


@pytest.mark.parametrize("hand", [SMALL, SEVERAL, ORIGINAL], ids=["flat8", "rig4", "original"])
@pytest.mark.parametrize("case", range(6))
def test_sensed_messages_equal_a_plain_recomputation_for_any_combination_of_rules(hand, case):
    """Case 0 uses the default rules, the others switch rules on and off at random."""
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    base = OriginalRules() if hand is ORIGINAL else GENERAL
    switches = ("stale_contacts", "any_partner", "first_entry_only", "last_name_wins")
    rules = replace(base, **{name: bool(rng.integers(2)) for name in switches if case > 0})
    times = np.array([0.1, 0.25, 0.3, 0.65])
    poses = np.tile(np.eye(4), (len(times), len(hand.boards), 1, 1))
    poses[..., :3, 3] = rng.normal(scale=0.0005, size=(len(times), len(hand.boards), 3))
    messages = make_random_messages(hand, rng, periods=3)
    result = sense_messages(hand, poses, times, messages, rules)
    expected = recompute_plainly(hand, poses, times, messages, rules)
    assert any(expected) or hand is not ORIGINAL  # few messages of a small hand may all be empty
    for sample, forces in enumerate(expected):
        assert np.flatnonzero(result.active[sample]).tolist() == sorted(forces)
        np.testing.assert_array_equal(result.force_n[sample, sorted(forces)], [forces[t] for t in sorted(forces)])
    assert (result.force_n[~result.active] == 0).all()


def test_a_larger_threshold_only_adds_taxels():
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    messages = make_random_messages(ORIGINAL, np.random.default_rng(seed), periods=1)
    poses, times = np.tile(np.eye(4), (1, len(ORIGINAL.boards), 1, 1)), np.array([1.0])
    previous = np.zeros((1, ORIGINAL.n_taxels), bool)
    for threshold in sorted(THRESHOLD_HISTORY_M.values()):
        rules = replace(OriginalRules(), threshold_m=threshold)
        active = sense_messages(ORIGINAL, poses, times, messages, rules).active
        assert (active | ~previous).all()
        previous = active


@pytest.mark.parametrize(
    ("field", "value"), [("threshold_m", 0.0), ("threshold_m", np.nan), ("palm_tips_m", -1e-3), ("overlap_m", -1e-3)]
)
def test_impossible_distances_are_refused(field, value):
    with pytest.raises(ValueError, match=field):
        OriginalRules(**{field: value})


@pytest.fixture(scope="module")
def scene():
    """Build a scene of a cylinder and the original hand, whose boards have palm tips but no soft layer."""
    return build_scene(ORIGINAL, CYLINDER, "palm", layer_m=get_surface_heights(ORIGINAL, OriginalRules()))


@pytest.fixture(scope="module")
def approach():
    """Make a grasp of the cylinder from the side, with the surface of the palm at its tips."""
    hand = replace(ORIGINAL, layer_m=PALM_TIPS_M)
    return make_approach(CYLINDER, "side_1", PALM_PLACEMENTS["cylinder", "side_1"], hand, withdraw_m=0.02)


def test_a_simulated_grasp_activates_palm_tips_and_fingers_and_only_taxels_with_coordinates(scene, approach):
    rules = OriginalRules()
    settings = SimulationSettings(recorder=make_recorder_settings(ORIGINAL, rules))
    motion = simulate_grasp(scene, approach, Timeline(0.2, 2.0, 1.0, 0.3, 0.2), settings)
    result = sense(ORIGINAL, CYLINDER.shape, motion, Sensing("original", original=rules))
    active, palm = result.signal_force[motion.phase == Phase.HOLD][-1] > 0, ORIGINAL.get_slice(0x15)
    assert active[palm].any()
    assert active.sum() > active[palm].sum()
    assert not active[np.isnan(get_centres(ORIGINAL, rules)).any(axis=1)].any()
    assert not result.signal_force[motion.phase == Phase.BASELINE].any()
    tip_distances_m = [
        point
        for message in motion.messages
        if ORIGINAL.boards[message.board].name == "palm"
        for entry in message.entries
        for point in CYLINDER.shape.signed_distance(entry.position - motion.object_pose[0, :3, 3])
    ]
    assert tip_distances_m
    assert np.abs(tip_distances_m).max() < 0.004  # the palm pushes the object away from its first pose


def test_a_pad_has_four_corners_in_its_plane():
    corners = find_pad_corners(np.zeros((1, 3)), np.array([[0.0, 0, 1]]), np.array([[1.0, 0, 0]]))
    half = np.array(PAD_M) / 2
    assert sorted(map(tuple, corners.tolist())) == [(i * half[0], k * half[1], 0.0) for i in (-1, 1) for k in (-1, 1)]


def test_a_larger_overlap_adds_corners_of_pads_near_the_object(scene, approach):
    """A board reports the corners of all pads that are at most `overlap_m` farther from the object than the nearest.

    Without overlap the fingers report the few points of the engine, which activate few taxels around a cylinder.
    """
    on_fingers, numbers = ORIGINAL.board_index != [board.name for board in ORIGINAL.boards].index("palm"), []
    for overlap_m in (0.0, OVERLAP_M, 2 * OVERLAP_M):
        rules = replace(OriginalRules(), overlap_m=overlap_m, coded_centres=False)
        settings = SimulationSettings(recorder=make_recorder_settings(ORIGINAL, rules))
        motion = simulate_grasp(scene, approach, Timeline(0.0, 2.0, 0.4, 0.0, 0.0), settings)
        active = sense(ORIGINAL, CYLINDER.shape, motion, Sensing("original", original=rules)).signal_force[-1] > 0
        numbers.append(int(active[on_fingers].sum()))
        points = [entry.position for message in motion.messages for entry in message.entries if OBJECT in entry.bodies]
        to_object = inverse(motion.object_pose)  # the hand moves and tilts the object while it closes
        distance = CYLINDER.shape.signed_distance(apply(to_object, np.concatenate(points))).min(axis=0)
        assert distance.max() < 0.004
    assert numbers[0] < numbers[1] <= numbers[2]


def test_messages_contain_one_entry_for_each_pair_unless_all_entries_are_recorded(scene, approach):
    timeline = Timeline(0.0, 1.0, 0.4, 0.0, 0.0)
    numbers = {}
    for only_first in (True, False):
        settings = SimulationSettings(recorder=RecorderSettings(first_entries_only=only_first))
        motion = simulate_grasp(scene, approach, timeline, settings)
        times = [message.time_s for message in motion.messages]
        assert times == sorted(times)
        assert len(times) % len(ORIGINAL.boards) == 0
        numbers[only_first] = [len(message.entries) for message in motion.messages]
        if only_first:
            pairs = [[frozenset(entry.bodies) for entry in message.entries] for message in motion.messages]
            assert all(len(set(message_pairs)) == len(message_pairs) for message_pairs in pairs)
    assert sum(numbers[False]) > 20 * sum(numbers[True]) > 0


def test_recorded_messages_need_rigid_contact_and_the_sensing_level_original_needs_messages(scene, approach):
    """Messages contain the contact points of rigid bodies, as the contact sensors of the original simulator do."""
    timeline = Timeline(0.0, 0.1, 0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="recorder: expected rigid contact"):
        simulate_grasp(scene, approach, timeline, SimulationSettings(law=LayerLaw(), recorder=RecorderSettings()))
    motion = simulate_grasp(scene, approach, timeline)
    with pytest.raises(ValueError, match="expected a motion with messages"):
        sense(ORIGINAL, CYLINDER.shape, motion, Sensing("original"))
