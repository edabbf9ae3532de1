"""Open, shorted and swapped lines from the raw counts of an untouched board."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host.tests.bench.synthetic_boards import (
    FULL_SCALE,
    KINDS,
    NAMES,
    measure_at_rest,
    sample_capacitances,
    with_open_line,
    with_shorted_lines,
    with_swapped_lines,
)
from taxel.hand import BoardKind
from taxel_tools.bench.analysis.at_rest import compute_standard_error, find_line_faults
from taxel_tools.bench.analysis.fault import (
    Axis,
    format_connector_pin,
    format_line_name,
    format_line_pair_name,
    get_lines_of_taxels,
)

LIMIT = 0.6
"""Lower limit of the relative capacitance of a line."""

property_settings = settings(max_examples=40, deadline=None)
kinds = st.sampled_from(NAMES).map(KINDS.__getitem__)
seeds = st.integers(0, 2**32 - 1)
axes = st.sampled_from(list(Axis))


def list_faults(kind, hardware, rng):
    """List the (fault, place) pairs of the line faults found in hardware counts f64[taxels] that are measured with
    noise.
    """
    return [(fault.name, fault.place) for fault in find_line_faults(measure_at_rest(kind, hardware, rng), LIMIT)[0]]


def sample_line(data, kind, axis):
    """Sample the number of a TX or RX line that has taxels; Hypothesis chooses it."""
    return data.draw(st.sampled_from(sorted(set(get_lines_of_taxels(kind, axis).tolist()))))


@property_settings
@given(kinds, seeds, st.floats(0.005, 0.08))
def test_a_healthy_board_has_no_line_fault(kind, seed, spread):
    rng = np.random.default_rng(seed)
    faults, explained = find_line_faults(measure_at_rest(kind, sample_capacitances(kind, rng, spread), rng), LIMIT)
    assert faults == []
    assert not explained.any()


@property_settings
@given(st.data(), kinds, axes, seeds, st.floats(0.0, 0.4))
def test_an_open_line_is_reported_with_its_connector_pin(data, kind, axis, seed, remaining_share):
    index = sample_line(data, kind, axis)
    rng = np.random.default_rng(seed)
    hardware = with_open_line(kind, sample_capacitances(kind, rng), axis, index, remaining_share)
    faults, explained = find_line_faults(measure_at_rest(kind, hardware, rng), LIMIT)
    assert [(fault.name, fault.place) for fault in faults] == [("open line", format_line_name(axis, index))]
    assert f"check {format_connector_pin(axis, index, kind.tx_count)} " in faults[0].text
    assert faults[0].severity > 1.0  # limit divided by value: the capacitance is below its limit
    assert (explained == (get_lines_of_taxels(kind, axis) == index)).all()


@property_settings
@given(st.data(), kinds, axes, seeds, st.floats(0.3, 0.7))
def test_shorted_lines_cause_no_other_fault(data, kind, axis, seed, share):
    # share: signal of each shorted line, as a share of the sum of both lines
    count = kind.crossings.shape[axis]
    index = data.draw(st.integers(0, count - 2))
    rng = np.random.default_rng(seed)
    hardware = with_shorted_lines(kind, sample_capacitances(kind, rng), axis, index, share)
    # A short of lines with few common crossings may stay undetected, so an empty list is permitted.
    assert set(list_faults(kind, hardware, rng)) <= {("short", format_line_pair_name(axis, index, index + 1))}


@pytest.mark.parametrize("axis", list(Axis))
def test_shorted_lines_with_at_least_four_common_crossings_are_reported(axis):
    kind = KINDS["palm"]
    table = kind.crossings if axis is Axis.TX else kind.crossings.T
    tested_count = 0
    for index in range(len(table) - 1):
        if (table[index] & table[index + 1]).sum() >= 4:
            rng = np.random.default_rng(index)
            hardware = with_shorted_lines(kind, sample_capacitances(kind, rng), axis, index)
            assert list_faults(kind, hardware, rng) == [("short", format_line_pair_name(axis, index, index + 1))]
            tested_count += 1
    assert tested_count >= 5


def test_unshared_crossings_of_shorted_lines_are_not_missing():
    kind, rng = KINDS["medial_front"], np.random.default_rng(0)
    hardware = with_shorted_lines(kind, sample_capacitances(kind, rng), Axis.TX, 0, share=0.5625)
    assert list_faults(kind, hardware, rng) == [("short", "TX 0 and TX 1")]


def test_shorted_lines_at_the_full_scale_count_are_reported():
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    hardware = with_shorted_lines(kind, sample_capacitances(kind, rng), Axis.TX, 4, share=1.0)
    assert list_faults(kind, np.minimum(hardware, FULL_SCALE), rng) == [("short", "TX 4 and TX 5")]


@property_settings
@given(st.data(), kinds, axes, seeds)
def test_swapped_lines_have_a_fault_unless_both_lines_have_the_same_crossings(data, kind, axis, seed):
    first_line = sample_line(data, kind, axis)
    second_line = data.draw(st.sampled_from([line for line in range(kind.crossings.shape[axis]) if line != first_line]))
    rng = np.random.default_rng(seed)
    names = list_faults(
        kind, with_swapped_lines(kind, sample_capacitances(kind, rng), axis, first_line, second_line), rng
    )
    places = {place for name, place in names if name == "swapped lines"}
    table = kind.crossings if axis is Axis.TX else kind.crossings.T
    if (table[first_line] == table[second_line]).all():
        assert names == []  # Only indentations distinguish these lines.
    else:
        assert names
    assert places <= {format_line_pair_name(axis, first_line, second_line)}


def test_swapped_lines_of_different_length_are_reported():
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    table = kind.crossings
    first_line, second_line = 0, next(line for line in range(1, len(table)) if (table[line] & ~table[0]).any())
    names = list_faults(
        kind, with_swapped_lines(kind, sample_capacitances(kind, rng), Axis.TX, first_line, second_line), rng
    )
    assert names == [("swapped lines", format_line_pair_name(Axis.TX, first_line, second_line))]


def test_a_crossing_without_capacitance_is_a_missing_crossing():
    kind, rng = KINDS["fingertip"], np.random.default_rng(1)
    hardware = sample_capacitances(kind, rng)
    hardware[17] *= 0.1
    (fault,) = find_line_faults(measure_at_rest(kind, hardware, rng), LIMIT)[0]
    assert (fault.name, fault.place) == ("missing crossing", "taxel 17")
    assert f"TX {kind.tx[17]}, RX {kind.rx[17]}" in fault.text
    assert 5.0 < fault.severity < 7.0  # limit 0.6 divided by the remaining capacitance, about 0.1


def test_a_crossing_of_two_open_lines_is_explained_once():
    """TX 6 and RX 5 keep 2 % of their capacitance; their common crossing must not appear as a third fault."""
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    hardware = with_open_line(
        kind, with_open_line(kind, sample_capacitances(kind, rng), Axis.TX, 6, 0.02), Axis.RX, 5, 0.02
    )
    assert sorted(list_faults(kind, hardware, rng)) == [("open line", "RX 5"), ("open line", "TX 6")]


def test_a_board_with_one_line_has_no_shorts():
    kind = BoardKind("strip", 9, np.ones((1, 6), bool))
    assert list_faults(kind, sample_capacitances(kind, np.random.default_rng(1)), np.random.default_rng(2)) == []


def test_connector_pins_are_numbered_tx_lines_first():
    assert [
        format_connector_pin(Axis.TX, 0, 13),
        format_connector_pin(Axis.TX, 12, 13),
        format_connector_pin(Axis.RX, 0, 13),
    ] == [
        "J1 pin 1",
        "J1 pin 13",
        "J1 pin 14",
    ]


def test_the_standard_error_of_a_mean_includes_slow_noise():
    """1000 frames of 30 taxels; the slow noise is constant for 100 frames, so only 10 values are independent."""
    rng = np.random.default_rng(1)
    white = rng.normal(2000.0, 4.0, (1000, 30)).round().astype(np.uint16)
    slow = (white + np.repeat(rng.normal(0.0, 10.0, (10, 30)), 100, axis=0)).round().astype(np.uint16)
    assert compute_standard_error(white) == pytest.approx(4.0 / np.sqrt(1000), rel=0.5)
    assert compute_standard_error(slow) == pytest.approx(10.0 / np.sqrt(10), rel=0.5)


def test_the_standard_error_of_a_short_record_is_that_of_white_noise():
    record = np.random.default_rng(1).normal(2000.0, 4.0, (20, 30)).round().astype(np.uint16)
    assert compute_standard_error(record) == pytest.approx(4.0 / np.sqrt(20), rel=0.8)
