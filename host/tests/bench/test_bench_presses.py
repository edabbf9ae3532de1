"""What a board answers to presses: which taxel, which line, how much, and what shows elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host.tests.bench.synthetic_boards import (
    KINDS,
    NAMES,
    presses,
    responses,
    with_exchanged_lines,
    with_joined_lines,
    with_open_line,
)
from taxel_tools.bench.analysis.fault import Axis, line_name, lines_name, lines_of
from taxel_tools.bench.analysis.presses import crosstalk, gain_fault, press_faults

LEAST = 0.4

some = settings(max_examples=40, deadline=None)
kinds = st.sampled_from(NAMES).map(KINDS.__getitem__)
seeds = st.integers(0, 2**32 - 1)
axes = st.sampled_from(list(Axis))


def named(kind, response, rng):
    return [(fault.name, fault.place) for fault in press_faults(presses(kind, response, rng), LEAST)]


def rowwise(change, kind, response, *arguments):
    """Every press is measured through the same fault."""
    return np.array([change(kind, row, *arguments) for row in response])


@some
@given(kinds, seeds)
def test_a_sound_board_has_no_fault_and_no_crosstalk(kind, seed):
    rng = np.random.default_rng(seed)
    measured = presses(kind, responses(kind, rng), rng)
    assert press_faults(measured, LEAST) == []
    assert abs(crosstalk(measured, np.zeros(kind.taxel_count, bool))[0].share) < 0.005
    assert gain_fault(measured, measured.usual, 400.0, 1200.0) is None


@some
@given(st.data(), kinds, seeds, st.floats(0.0, 0.25))
def test_a_dead_taxel_is_named(data, kind, seed, left):
    taxel = data.draw(st.integers(0, kind.taxel_count - 1))
    rng = np.random.default_rng(seed)
    response = responses(kind, rng)
    response[taxel, taxel] *= left
    assert named(kind, response, rng) == [("dead taxel", f"taxel {taxel}")]


@some
@given(st.data(), kinds, axes, seeds)
def test_exchanged_lines_are_named(data, kind, axis, seed):
    lines = sorted(set(lines_of(kind, axis).tolist()))
    first = data.draw(st.sampled_from(lines))
    second = data.draw(st.sampled_from([line for line in lines if line != first]))
    table = kind.crossings if axis is Axis.TX else kind.crossings.T
    rng = np.random.default_rng(seed)
    names = named(kind, rowwise(with_exchanged_lines, kind, responses(kind, rng), axis, first, second), rng)
    if (table[first] & table[second]).any():
        assert names == [("swapped lines", lines_name(axis, first, second))]
    else:
        assert names  # no press of one can arrive on the other: their taxels are dead


@some
@given(st.data(), kinds, axes, seeds, st.floats(0.3, 0.7))
def test_joined_lines_are_named(data, kind, axis, seed, share):
    table = kind.crossings if axis is Axis.TX else kind.crossings.T
    sharing = [index for index in range(len(table) - 1) if (table[index] & table[index + 1]).any()]
    index = data.draw(st.sampled_from(sharing))
    rng = np.random.default_rng(seed)
    names = named(kind, rowwise(with_joined_lines, kind, responses(kind, rng), axis, index, share), rng)
    assert names == [("short", lines_name(axis, index, index + 1))]


@some
@given(st.data(), kinds, axes, seeds)
def test_a_line_without_answers_is_open(data, kind, axis, seed):
    index = data.draw(st.sampled_from(sorted(set(lines_of(kind, axis).tolist()))))
    on_line = lines_of(kind, axis) == index
    rng = np.random.default_rng(seed)
    names = named(kind, rowwise(with_open_line, kind, responses(kind, rng), axis, index, 0.0), rng)
    if on_line.sum() > 1:
        assert names == [("open line", line_name(axis, index))]
    else:
        assert names == [("dead taxel", f"taxel {np.flatnonzero(on_line)[0]}")]


@some
@given(kinds, seeds)
def test_a_board_that_answers_nothing_is_one_fault(kind, seed):
    rng = np.random.default_rng(seed)
    assert named(kind, responses(kind, rng, counts=0.0), rng) == [("no response", "board")]


@pytest.mark.parametrize(("counts", "name", "severity"), [(100.0, "low gain", 4.0), (2400.0, "high gain", 2.0)])
def test_gain_is_that_of_the_median_press(counts, name, severity):
    rng = np.random.default_rng(1)
    kind = KINDS["palm"]
    response = responses(kind, rng, counts, spread=0.02)
    measured = presses(kind, response, rng)
    fault = gain_fault(measured, measured.usual, 400.0, 1200.0)
    assert (fault.name, fault.place) == (name, "board")
    assert fault.severity == pytest.approx(severity, rel=0.05)
    assert gain_fault(presses(kind, response, rng, force_n=float("nan")), measured.usual, 400.0, 1200.0) is None


@pytest.mark.parametrize(
    ("along", "name"),
    [("tx", "along TX lines"), ("rx", "along RX lines")],
)
def test_crosstalk_is_recovered_along_a_line(along, name):
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    response = responses(kind, rng)
    line = getattr(kind, along)
    own = np.diagonal(response)
    response += 0.08 * own[:, None] * ((line[:, None] == line[None, :]) & ~np.eye(kind.taxel_count, dtype=bool))
    talk = crosstalk(presses(kind, response, rng), np.zeros(kind.taxel_count, bool))[0]
    assert (talk.where, talk.is_sure) == (name, True)
    assert talk.share == pytest.approx(0.08, abs=0.004)


def test_crosstalk_between_neighbouring_lines_is_its_own_figure():
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    response = responses(kind, rng)
    tx, rx = kind.tx.astype(int), kind.rx.astype(int)
    beside = (np.abs(tx[:, None] - tx) == 1) & (rx[:, None] == rx)
    response += 0.05 * np.diagonal(response)[:, None] * beside
    first, *others = crosstalk(presses(kind, response, rng), np.zeros(kind.taxel_count, bool))
    assert (first.where, round(first.share, 2)) == ("between TX lines", 0.05)
    assert max(abs(one.share) for one in others) < 0.005


def test_crosstalk_that_noise_explains_is_not_sure():
    kind, rng = KINDS["medial_front"], np.random.default_rng(1)
    measured = presses(kind, responses(kind, rng, counts=20.0), rng)
    assert not any(one.is_sure for one in crosstalk(measured, np.zeros(kind.taxel_count, bool)))


def test_the_gain_of_a_board_is_that_of_its_sound_taxels():
    kind, rng = KINDS["medial_front"], np.random.default_rng(1)
    response = rowwise(with_joined_lines, kind, responses(kind, rng), Axis.RX, 1)
    measured = presses(kind, response, rng)
    sound = (kind.rx != 1) & (kind.rx != 2)
    assert measured.usual_of(sound) == pytest.approx(700.0, rel=0.1)
    assert measured.usual_of(~sound) == pytest.approx(350.0, rel=0.1)
    assert measured.usual_of(np.zeros(kind.taxel_count, bool)) == measured.usual


def test_taxels_that_were_not_pressed_are_left_out():
    kind, rng = KINDS["fingertip"], np.random.default_rng(1)
    response = responses(kind, rng)
    response[10:] = np.nan
    measured = presses(kind, response, rng)
    assert measured.pressed.tolist() == list(range(10))
    assert press_faults(measured, LEAST) == []
    assert measured.usual == pytest.approx(700.0, rel=0.1)
