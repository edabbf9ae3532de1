"""Broken, joined and exchanged lines from the counts of an untouched board."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host.tests.bench.synthetic_boards import (
    KINDS,
    LARGEST,
    NAMES,
    at_rest,
    capacitances,
    with_exchanged_lines,
    with_joined_lines,
    with_open_line,
)
from taxel.hand import BoardKind
from taxel_tools.bench.analysis.at_rest import line_faults, mean_error
from taxel_tools.bench.analysis.fault import Axis, joint, line_name, lines_name, lines_of

LEAST = 0.6

some = settings(max_examples=40, deadline=None)
kinds = st.sampled_from(NAMES).map(KINDS.__getitem__)
seeds = st.integers(0, 2**32 - 1)
axes = st.sampled_from(list(Axis))


def found(kind, hardware, rng):
    return [(fault.name, fault.place) for fault in line_faults(at_rest(kind, hardware, rng), LEAST)[0]]


def line_of(data, kind, axis):
    return data.draw(st.sampled_from(sorted(set(lines_of(kind, axis).tolist()))))


@some
@given(kinds, seeds, st.floats(0.005, 0.08))
def test_nothing_is_wrong_with_a_sound_board(kind, seed, spread):
    rng = np.random.default_rng(seed)
    faults, explained = line_faults(at_rest(kind, capacitances(kind, rng, spread), rng), LEAST)
    assert faults == []
    assert not explained.any()


@some
@given(st.data(), kinds, axes, seeds, st.floats(0.0, 0.4))
def test_a_broken_line_is_named_with_its_joint(data, kind, axis, seed, left):
    index = line_of(data, kind, axis)
    rng = np.random.default_rng(seed)
    hardware = with_open_line(kind, capacitances(kind, rng), axis, index, left)
    faults, explained = line_faults(at_rest(kind, hardware, rng), LEAST)
    assert [(fault.name, fault.place) for fault in faults] == [("open line", line_name(axis, index))]
    assert f"look at {joint(axis, index, kind.tx_count)} " in faults[0].text
    assert faults[0].severity > 1.0
    assert (explained == (lines_of(kind, axis) == index)).all()


@some
@given(st.data(), kinds, axes, seeds, st.floats(0.3, 0.7))
def test_joined_lines_are_named_or_nothing_is(data, kind, axis, seed, share):
    count = kind.crossings.shape[axis]
    index = data.draw(st.integers(0, count - 2))
    rng = np.random.default_rng(seed)
    names = found(kind, with_joined_lines(kind, capacitances(kind, rng), axis, index, share), rng)
    assert {name for name, _ in names} <= {"short"}
    assert {place for _, place in names} <= {lines_name(axis, index, index + 1)}


@pytest.mark.parametrize("axis", list(Axis))
def test_joined_lines_are_named_where_they_share_four_crossings_or_more(axis):
    kind = KINDS["palm"]
    table = kind.crossings if axis is Axis.TX else kind.crossings.T
    tried = 0
    for index in range(len(table) - 1):
        if (table[index] & table[index + 1]).sum() >= 4:
            rng = np.random.default_rng(index)
            hardware = with_joined_lines(kind, capacitances(kind, rng), axis, index)
            assert found(kind, hardware, rng) == [("short", lines_name(axis, index, index + 1))]
            tried += 1
    assert tried >= 5


def test_crossings_that_only_one_of_two_joined_lines_has_are_not_missing():
    kind, rng = KINDS["medial_front"], np.random.default_rng(0)
    hardware = with_joined_lines(kind, capacitances(kind, rng), Axis.TX, 0, share=0.5625)
    assert found(kind, hardware, rng) == [("short", "TX 0 and TX 1")]


def test_joined_lines_at_the_converters_stop_are_named():
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    hardware = with_joined_lines(kind, capacitances(kind, rng), Axis.TX, 4, share=1.0)
    assert found(kind, np.minimum(hardware, LARGEST), rng) == [("short", "TX 4 and TX 5")]


@some
@given(st.data(), kinds, axes, seeds)
def test_exchanged_lines_are_named_or_their_missing_crossings_are(data, kind, axis, seed):
    first = line_of(data, kind, axis)
    second = data.draw(st.sampled_from([one for one in range(kind.crossings.shape[axis]) if one != first]))
    rng = np.random.default_rng(seed)
    names = found(kind, with_exchanged_lines(kind, capacitances(kind, rng), axis, first, second), rng)
    places = {place for name, place in names if name == "swapped lines"}
    table = kind.crossings if axis is Axis.TX else kind.crossings.T
    if (table[first] == table[second]).all():
        assert names == []  # only a press can tell
    else:
        assert names
    assert places <= {lines_name(axis, first, second)}


def test_exchanged_lines_of_different_length_are_named():
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    table = kind.crossings
    first, second = 0, next(one for one in range(1, len(table)) if (table[one] & ~table[0]).any())
    names = found(kind, with_exchanged_lines(kind, capacitances(kind, rng), Axis.TX, first, second), rng)
    assert names == [("swapped lines", lines_name(Axis.TX, first, second))]


def test_one_crossing_without_capacitance_is_a_missing_crossing():
    kind, rng = KINDS["fingertip"], np.random.default_rng(1)
    hardware = capacitances(kind, rng)
    hardware[17] *= 0.1
    (fault,) = line_faults(at_rest(kind, hardware, rng), LEAST)[0]
    assert (fault.name, fault.place) == ("missing crossing", "taxel 17")
    assert f"TX {kind.tx[17]}, RX {kind.rx[17]}" in fault.text
    assert 5.0 < fault.severity < 7.0


def test_a_crossing_of_two_broken_lines_is_explained_once():
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    hardware = with_open_line(kind, with_open_line(kind, capacitances(kind, rng), Axis.TX, 6, 0.02), Axis.RX, 5, 0.02)
    assert sorted(found(kind, hardware, rng)) == [("open line", "RX 5"), ("open line", "TX 6")]


def test_a_board_of_one_line_has_no_pairs():
    kind = BoardKind("strip", 9, np.ones((1, 6), bool))
    assert found(kind, capacitances(kind, np.random.default_rng(1)), np.random.default_rng(2)) == []


def test_joints_are_numbered_from_the_tx_lines_on():
    assert [joint(Axis.TX, 0, 13), joint(Axis.TX, 12, 13), joint(Axis.RX, 0, 13)] == [
        "J1 pin 1",
        "J1 pin 13",
        "J1 pin 14",
    ]


def test_the_error_of_a_mean_counts_slow_noise():
    rng = np.random.default_rng(1)
    white = rng.normal(2000.0, 4.0, (1000, 30)).round().astype(np.uint16)
    slow = (white + np.repeat(rng.normal(0.0, 10.0, (10, 30)), 100, axis=0)).round().astype(np.uint16)
    assert mean_error(white) == pytest.approx(4.0 / np.sqrt(1000), rel=0.5)
    assert mean_error(slow) == pytest.approx(10.0 / np.sqrt(10), rel=0.5)
    few = mean_error(white[:20])
    assert few == pytest.approx(4.0 / np.sqrt(20), rel=0.8)
