"""Response of a board to indentations: dead taxels, line faults, gain and crosstalk."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from host.tests.bench.synthetic_boards import (
    KINDS,
    NAMES,
    measure_indentations,
    sample_responses,
    with_open_line,
    with_shorted_lines,
    with_swapped_lines,
)
from taxel_tools.bench.analysis.fault import Axis, format_line_name, format_line_pair_name, get_lines_of_taxels
from taxel_tools.bench.analysis.indentations import find_gain_fault, find_response_faults, measure_crosstalk

LIMIT = 0.4
"""Lower limit of the response of a taxel relative to the median."""

property_settings = settings(max_examples=40, deadline=None)
kinds = st.sampled_from(NAMES).map(KINDS.__getitem__)
seeds = st.integers(0, 2**32 - 1)
axes = st.sampled_from(list(Axis))


def list_faults(kind, response, rng):
    """List the (fault, place) pairs found in a response matrix f64[taxels, taxels] that is measured with noise."""
    return [
        (fault.name, fault.place) for fault in find_response_faults(measure_indentations(kind, response, rng), LIMIT)
    ]


def apply_to_rows(change, kind, response, *arguments):
    """Apply a fault of the board (`change`) to each row of a response matrix; a row is one indentation."""
    return np.array([change(kind, row, *arguments) for row in response])


@property_settings
@given(kinds, seeds)
def test_a_healthy_board_has_no_fault_and_no_crosstalk(kind, seed):
    rng = np.random.default_rng(seed)
    indentations = measure_indentations(kind, sample_responses(kind, rng), rng)
    assert find_response_faults(indentations, LIMIT) == []
    # The largest crosstalk is below 0.5 % of the response, and 400 to 1200 counts are permitted for the median.
    assert abs(measure_crosstalk(indentations, np.zeros(kind.taxel_count, bool))[0].share) < 0.005
    assert find_gain_fault(indentations, indentations.median_response, 400.0, 1200.0) is None


@property_settings
@given(st.data(), kinds, seeds, st.floats(0.0, 0.25))
def test_a_dead_taxel_is_reported(data, kind, seed, remaining_share):
    taxel = data.draw(st.integers(0, kind.taxel_count - 1))
    rng = np.random.default_rng(seed)
    response = sample_responses(kind, rng)
    response[taxel, taxel] *= remaining_share
    assert list_faults(kind, response, rng) == [("dead taxel", f"taxel {taxel}")]


@property_settings
@given(st.data(), kinds, axes, seeds)
def test_swapped_lines_are_reported(data, kind, axis, seed):
    lines = sorted(set(get_lines_of_taxels(kind, axis).tolist()))
    first_line = data.draw(st.sampled_from(lines))
    second_line = data.draw(st.sampled_from([line for line in lines if line != first_line]))
    table = kind.crossings if axis is Axis.TX else kind.crossings.T
    rng = np.random.default_rng(seed)
    names = list_faults(
        kind, apply_to_rows(with_swapped_lines, kind, sample_responses(kind, rng), axis, first_line, second_line), rng
    )
    if (table[first_line] & table[second_line]).any():
        assert names == [("swapped lines", format_line_pair_name(axis, first_line, second_line))]
    else:
        assert names  # Without a common crossing, the taxels of both lines are dead.


@property_settings
@given(st.data(), kinds, axes, seeds, st.floats(0.3, 0.7))
def test_shorted_lines_are_reported(data, kind, axis, seed, share):
    table = kind.crossings if axis is Axis.TX else kind.crossings.T
    candidates = [index for index in range(len(table) - 1) if (table[index] & table[index + 1]).any()]
    index = data.draw(st.sampled_from(candidates))
    rng = np.random.default_rng(seed)
    names = list_faults(
        kind, apply_to_rows(with_shorted_lines, kind, sample_responses(kind, rng), axis, index, share), rng
    )
    assert names == [("short", format_line_pair_name(axis, index, index + 1))]


@property_settings
@given(st.data(), kinds, axes, seeds)
def test_a_line_without_response_is_open(data, kind, axis, seed):
    index = data.draw(st.sampled_from(sorted(set(get_lines_of_taxels(kind, axis).tolist()))))
    on_line = get_lines_of_taxels(kind, axis) == index
    rng = np.random.default_rng(seed)
    names = list_faults(kind, apply_to_rows(with_open_line, kind, sample_responses(kind, rng), axis, index, 0.0), rng)
    if on_line.sum() > 1:
        assert names == [("open line", format_line_name(axis, index))]
    else:
        assert names == [("dead taxel", f"taxel {np.flatnonzero(on_line)[0]}")]


@property_settings
@given(kinds, seeds)
def test_a_board_without_response_has_one_fault(kind, seed):
    rng = np.random.default_rng(seed)
    assert list_faults(kind, sample_responses(kind, rng, counts=0.0), rng) == [("no response", "board")]


@pytest.mark.parametrize(("counts", "name", "severity"), [(100.0, "low gain", 4.0), (2400.0, "high gain", 2.0)])
def test_a_median_response_outside_its_range_is_a_gain_fault(counts, name, severity):
    """Permitted are 400 to 1200 counts. The severity is the factor by which the response is beyond this limit."""
    rng = np.random.default_rng(1)
    kind = KINDS["palm"]
    response = sample_responses(kind, rng, counts, spread=0.02)
    indentations = measure_indentations(kind, response, rng)
    fault = find_gain_fault(indentations, indentations.median_response, 400.0, 1200.0)
    assert (fault.name, fault.place) == (name, "board")
    assert fault.severity == pytest.approx(severity, rel=0.05)


def test_the_gain_is_not_judged_if_the_force_is_unknown():
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    weak_response = sample_responses(kind, rng, counts=100.0)
    indentations = measure_indentations(kind, weak_response, rng, force_n=float("nan"))
    assert find_gain_fault(indentations, indentations.median_response, minimum=400.0, maximum=1200.0) is None


@pytest.mark.parametrize(
    ("along", "name"),
    [("tx", "along TX lines"), ("rx", "along RX lines")],
)
def test_crosstalk_is_recovered_along_a_line(along, name):
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    response = sample_responses(kind, rng)
    line = getattr(kind, along)
    own_response = np.diagonal(response)
    response += (
        0.08 * own_response[:, None] * ((line[:, None] == line[None, :]) & ~np.eye(kind.taxel_count, dtype=bool))
    )
    largest = measure_crosstalk(measure_indentations(kind, response, rng), np.zeros(kind.taxel_count, bool))[0]
    assert (largest.path, largest.is_significant) == (name, True)
    assert largest.share == pytest.approx(0.08, abs=0.004)


def test_crosstalk_between_neighbouring_lines_is_separate_from_crosstalk_along_lines():
    kind, rng = KINDS["palm"], np.random.default_rng(1)
    response = sample_responses(kind, rng)
    tx, rx = kind.tx.astype(int), kind.rx.astype(int)
    is_neighbour = (np.abs(tx[:, None] - tx) == 1) & (rx[:, None] == rx)
    response += 0.05 * np.diagonal(response)[:, None] * is_neighbour
    largest, *smaller = measure_crosstalk(measure_indentations(kind, response, rng), np.zeros(kind.taxel_count, bool))
    assert (largest.path, round(largest.share, 2)) == ("between TX lines", 0.05)
    assert max(abs(path.share) for path in smaller) < 0.005


def test_crosstalk_caused_by_noise_is_not_significant():
    kind, rng = KINDS["medial_front"], np.random.default_rng(1)
    indentations = measure_indentations(kind, sample_responses(kind, rng, counts=20.0), rng)
    assert not any(path.is_significant for path in measure_crosstalk(indentations, np.zeros(kind.taxel_count, bool)))


def test_the_gain_of_a_board_is_that_of_its_healthy_taxels():
    """RX lines 1 and 2 are shorted: each measures half of the response of 700 counts."""
    kind, rng = KINDS["medial_front"], np.random.default_rng(1)
    response = apply_to_rows(with_shorted_lines, kind, sample_responses(kind, rng), Axis.RX, 1)
    indentations = measure_indentations(kind, response, rng)
    is_healthy = (kind.rx != 1) & (kind.rx != 2)
    assert indentations.compute_median_response(is_healthy) == pytest.approx(700.0, rel=0.1)
    assert indentations.compute_median_response(~is_healthy) == pytest.approx(350.0, rel=0.1)
    assert indentations.compute_median_response(np.zeros(kind.taxel_count, bool)) == indentations.median_response


def test_taxels_without_an_indentation_are_ignored():
    kind, rng = KINDS["fingertip"], np.random.default_rng(1)
    response = sample_responses(kind, rng)
    response[10:] = np.nan
    indentations = measure_indentations(kind, response, rng)
    assert indentations.indented_taxels.tolist() == list(range(10))
    assert find_response_faults(indentations, LIMIT) == []
    assert indentations.median_response == pytest.approx(700.0, rel=0.1)
