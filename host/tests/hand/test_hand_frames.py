"""A frame buffer answers as tf2 would, and says in one line why it cannot."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from numpy.typing import NDArray

from taxel.hand.frame_errors import (
    DisconnectedFramesError,
    ExtrapolationError,
    FrameConflictError,
    FrameError,
    FrameLoopError,
    UnknownFrameError,
)
from taxel.hand.frames import FrameBuffer
from taxel.hand.transforms import from_rotation_vector, inverse, pose

SEED = 21
EXACT = 1e-12


def at_x(x: float) -> NDArray[np.float64]:
    return pose([x, 0, 0], [1, 0, 0, 0])


def random_pose(rng: np.random.Generator) -> NDArray[np.float64]:
    return pose(rng.normal(size=3), rng.normal(size=4))


def arm() -> FrameBuffer:
    """base > wrist (moving 0..4 s) > palm (static) > tip (moving 1..3 s), and base > object (static)."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    buffer = FrameBuffer()
    for stamp in range(5):
        buffer.set_transform("base", "wrist", random_pose(rng), stamp)
    buffer.set_static("wrist", "palm", random_pose(rng))
    for stamp in (1, 2, 3):
        buffer.set_transform("palm", "tip", random_pose(rng), stamp)
    buffer.set_static("base", "object", random_pose(rng))
    return buffer


def assert_one_line(error: FrameError, *pieces: str) -> None:
    line = str(error)
    assert line.isprintable()
    assert line.startswith("frames: ")
    for piece in pieces:
        assert piece in line
    copy = pickle.loads(pickle.dumps(error))
    assert str(copy) == line
    assert vars(copy) == vars(error)


def test_a_transform_maps_points_of_the_child_to_the_parent() -> None:
    buffer = FrameBuffer()
    buffer.set_static("base", "tool", at_x(2))
    assert np.array_equal(buffer.lookup("base", "tool"), at_x(2))
    assert np.array_equal(buffer.lookup("tool", "base"), at_x(-2))
    assert np.array_equal(buffer.lookup("base", "base"), np.eye(4))


def test_a_lookup_multiplies_along_the_tree() -> None:
    buffer = arm()
    wrist, palm = buffer.lookup("base", "wrist", 2), buffer.lookup("wrist", "palm")
    tip, thing = buffer.lookup("palm", "tip", 2), buffer.lookup("base", "object")
    expected = inverse(thing) @ wrist @ palm @ tip
    np.testing.assert_allclose(buffer.lookup("object", "tip", 2), expected, atol=EXACT)
    np.testing.assert_allclose(buffer.lookup("tip", "object", 2), inverse(expected), atol=EXACT)


def test_a_static_transform_holds_at_all_times() -> None:
    buffer = arm()
    assert np.array_equal(buffer.lookup("base", "object", -1e9), buffer.lookup("base", "object"))


def test_between_stamps_positions_are_linear_and_rotations_spherical() -> None:
    buffer = FrameBuffer()
    end = from_rotation_vector([0, 0, 1.0])
    end[:3, 3] = 4, 0, 0
    buffer.set_transform("base", "tool", np.eye(4), 10)
    buffer.set_transform("base", "tool", end, 12)
    expected = from_rotation_vector([0, 0, 0.25])
    expected[:3, 3] = 1, 0, 0
    np.testing.assert_allclose(buffer.lookup("base", "tool", 10.5), expected, atol=EXACT)


def test_at_a_stamp_the_transform_is_exact() -> None:
    rng = np.random.default_rng(SEED)
    given = [random_pose(rng) for _ in range(5)]
    buffer = FrameBuffer()
    for stamp, transform in enumerate(given):
        buffer.set_transform("base", "tool", transform, stamp)
    assert all(np.array_equal(buffer.lookup("base", "tool", stamp), given[stamp]) for stamp in range(5))


def test_without_a_time_the_latest_common_one_is_taken() -> None:
    buffer = arm()
    assert buffer.latest_common_time("base", "tip") == 3
    assert buffer.latest_common_time("base", "object") is None
    assert np.array_equal(buffer.lookup("base", "tip"), buffer.lookup("base", "tip", 3))
    assert np.array_equal(buffer.lookup("base", "palm"), buffer.lookup("base", "palm", 4))


def test_many_lookups_equal_one_by_one() -> None:
    buffer = arm()
    times, sources = np.array([1, 1.25, 2.5, 3]), ("tip", "object", "palm", "base")
    found = buffer.lookup_many("palm", sources, times)
    assert found.shape == (4, 4, 4, 4)
    for i, time in enumerate(times):
        for j, source in enumerate(sources):
            np.testing.assert_allclose(found[i, j], buffer.lookup("palm", source, time), atol=EXACT)
    assert buffer.lookup_many("palm", [], times).shape == (4, 0, 4, 4)
    assert buffer.lookup_many("palm", ["tip"], []).shape == (0, 1, 4, 4)


def test_stamps_may_come_in_any_order() -> None:
    print(f"seed {SEED}")
    stamps = np.random.default_rng(SEED).permutation(200) / 100
    buffer = FrameBuffer()
    for stamp in stamps:
        assert buffer.set_transform("base", "tool", at_x(stamp), stamp)
    times = np.linspace(0, 1.99, 333)
    np.testing.assert_allclose(buffer.lookup_many("base", ["tool"], times)[:, 0, 0, 3], times, atol=EXACT)


def test_a_second_transform_of_one_stamp_replaces_the_first() -> None:
    buffer = FrameBuffer()
    buffer.set_transform("base", "tool", at_x(1), 5)
    buffer.set_transform("base", "tool", at_x(2), 5)
    assert buffer.lookup("base", "tool", 5)[0, 3] == 2
    buffer.set_static("base", "object", at_x(1))
    buffer.set_static("base", "object", at_x(3))
    assert buffer.lookup("base", "object")[0, 3] == 3


def test_what_is_older_than_the_history_is_dropped() -> None:
    buffer = FrameBuffer(history_s=2)
    for stamp in range(100):
        buffer.set_transform("base", "tool", at_x(stamp), stamp)
    assert buffer.lookup("base", "tool", 97)[0, 3] == 97
    assert not buffer.can_transform("base", "tool", 96.5)
    assert not buffer.set_transform("base", "tool", at_x(0), 96.5)
    assert not buffer.can_transform("base", "tool", 96.5)


def test_a_long_run_does_not_grow_the_history() -> None:
    buffer = FrameBuffer(history_s=0.1)
    for tick in range(5000):
        buffer.set_transform("base", "tool", at_x(tick), tick * 0.01)
    history = buffer._edges["tool"].motion
    assert len(history) in (10, 11)
    assert history._stamps.size <= 32  # type: ignore[union-attr]


def test_frames_parents_and_chains_are_named() -> None:
    buffer = arm()
    assert buffer.frames() == ("base", "object", "palm", "tip", "wrist")
    assert buffer.parent_of("tip") == "palm"
    assert buffer.parent_of("base") is None
    assert buffer.chain("object", "tip") == ("object", "base", "wrist", "palm", "tip")
    assert buffer.chain("tip", "wrist") == ("tip", "palm", "wrist")
    assert buffer.chain("wrist", "tip") == ("wrist", "palm", "tip")
    assert buffer.chain("palm", "palm") == ("palm",)


def test_can_transform_says_whether_lookup_would_answer() -> None:
    buffer = arm()
    buffer.set_static("elsewhere", "lamp", np.eye(4))
    assert buffer.can_transform("base", "tip")
    assert buffer.can_transform("base", "tip", 2.5)
    assert not buffer.can_transform("base", "tip", 3.5)
    assert not buffer.can_transform("base", "lamp")
    assert not buffer.can_transform("base", "nothing")


def test_an_unknown_frame_is_answered_with_the_closest_one() -> None:
    with pytest.raises(UnknownFrameError) as caught:
        arm().lookup("base", "wirst")
    assert caught.value.frame == "wirst"
    assert_one_line(caught.value, "no frame 'wirst'; did you mean 'wrist'?")


def test_an_unknown_frame_without_a_close_one_is_answered_with_those_known() -> None:
    with pytest.raises(UnknownFrameError) as caught:
        arm().parent_of("zzz")
    assert_one_line(caught.value, "known are base, object, palm, tip, wrist")
    with pytest.raises(UnknownFrameError, match="the buffer is empty"):
        FrameBuffer().lookup("a", "b")


def test_frames_of_two_trees_are_answered_with_their_roots() -> None:
    buffer = arm()
    buffer.set_static("map", "table", np.eye(4))
    with pytest.raises(DisconnectedFramesError) as caught:
        buffer.lookup("table", "tip")
    assert (caught.value.target_root, caught.value.source_root) == ("map", "base")
    assert_one_line(caught.value, "found the roots 'map' and 'base'")


@pytest.mark.parametrize(
    ("time", "piece"), [(3.5, "0.5 s too late"), (0.25, "0.75 s too early"), (np.nan, "found nan")]
)
def test_a_time_outside_the_stamps_is_not_guessed(time: float, piece: str) -> None:
    for ask in (lambda b: b.lookup("base", "tip", time), lambda b: b.lookup_many("base", ["wrist", "tip"], [2, time])):
        with pytest.raises(ExtrapolationError) as caught:
            ask(arm())
        if time == time:
            edge = (caught.value.parent, caught.value.child, caught.value.first_s, caught.value.last_s)
            assert edge == ("palm", "tip", 1, 3)
            assert_one_line(caught.value, "'palm' to 'tip': expected a time from 1.0 to 3.0 s", piece)


def test_histories_that_do_not_overlap_have_no_common_time() -> None:
    buffer = FrameBuffer()
    buffer.set_transform("a", "b", np.eye(4), 1)
    buffer.set_transform("b", "c", np.eye(4), 2)
    with pytest.raises(ExtrapolationError) as caught:
        buffer.lookup("a", "c")
    assert (caught.value.time_s, caught.value.child) == (1, "c")
    assert not buffer.can_transform("a", "c")


def test_a_loop_is_refused_with_its_path() -> None:
    buffer = arm()
    with pytest.raises(FrameLoopError) as caught:
        buffer.set_static("tip", "base", np.eye(4))
    assert caught.value.path == ("base", "wrist", "palm", "tip")
    assert_one_line(caught.value, "'base' > 'wrist' > 'palm' > 'tip'")
    with pytest.raises(FrameLoopError):
        FrameBuffer().set_static("a", "a", np.eye(4))


def test_a_second_parent_is_refused() -> None:
    buffer = arm()
    with pytest.raises(FrameConflictError) as caught:
        buffer.set_transform("object", "wrist", np.eye(4), 9)
    assert_one_line(caught.value, "moving in 'base' as set before, found moving in 'object'")
    assert buffer.parent_of("wrist") == "base"


def test_a_static_frame_does_not_start_to_move_nor_a_moving_one_to_rest() -> None:
    buffer = arm()
    with pytest.raises(FrameConflictError, match="static in 'wrist' as set before, found moving in 'wrist'"):
        buffer.set_transform("wrist", "palm", np.eye(4), 1)
    with pytest.raises(FrameConflictError, match="moving in 'base' as set before, found static in 'base'"):
        buffer.set_static("base", "wrist", np.eye(4))


def test_a_refused_transform_leaves_no_frame_behind() -> None:
    buffer = FrameBuffer()
    for transform in (np.eye(3), np.eye(4) * 2, np.full((4, 4), np.nan)):
        with pytest.raises(ValueError, match=r"^transform: expected"):
            buffer.set_static("a", "b", transform)
    with pytest.raises(ValueError, match="stamp_s: expected a finite number"):
        buffer.set_transform("a", "b", np.eye(4), np.inf)
    with pytest.raises(ValueError, match="frame: expected a printable name, found ''"):
        buffer.set_static("", "b", np.eye(4))
    assert buffer.frames() == ()


def test_the_buffer_does_not_change_with_the_arrays_it_was_given_or_gave() -> None:
    buffer, given = FrameBuffer(), at_x(1)
    buffer.set_static("a", "b", given)
    buffer.set_transform("a", "c", given, 1)
    given[0, 3] = 5
    for frame in "bc":
        buffer.lookup("a", frame)[0, 3] = 7
        assert buffer.lookup("a", frame)[0, 3] == 1


@pytest.mark.parametrize("history", [0, -1, np.nan, np.inf])
def test_a_history_has_a_length(history: float) -> None:
    with pytest.raises(ValueError, match="history_s: expected"):
        FrameBuffer(history)
