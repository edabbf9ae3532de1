"""Merging of faults from raw counts at rest and from indentations: each fault is reported once."""

import numpy as np

from host.tests.bench.synthetic_boards import KINDS, measure_at_rest, measure_indentations, sample_responses
from taxel_tools.bench.analysis.at_rest import find_line_faults
from taxel_tools.bench.analysis.fault import Fault
from taxel_tools.bench.analysis.indentations import find_response_faults
from taxel_tools.bench.analysis.merging import find_taxels, merge_faults

KIND = KINDS["palm"]


def make_fault(name, location, severity=2.0):
    return Fault(name, location, "", severity)


def merge_to_pairs(rest_faults, response_faults):
    """List the (fault, place) pairs of the merged faults. response_faults: None without indentations."""
    return [(fault.name, fault.place) for fault in merge_faults(KIND, rest_faults, response_faults)]


def test_the_taxels_of_a_line_a_line_pair_a_taxel_and_the_board_are_found():
    assert (find_taxels(KIND, "TX 3") == (KIND.tx == 3)).all()
    assert (find_taxels(KIND, "RX 1 and RX 10") == ((KIND.rx == 1) | (KIND.rx == 10))).all()
    assert np.flatnonzero(find_taxels(KIND, "taxel 17")).tolist() == [17]
    assert find_taxels(KIND, "board").all()


def test_without_indentations_faults_at_rest_are_sorted_by_severity():
    faults = [make_fault("open line", "TX 3", 2.0), make_fault("open line", "RX 1", 5.0)]
    assert merge_to_pairs(faults, None) == [("open line", "RX 1"), ("open line", "TX 3")]


def test_an_open_line_detected_twice_is_reported_once():
    assert merge_to_pairs([make_fault("open line", "TX 3")], [make_fault("open line", "TX 3", 9.0)]) == [
        ("open line", "TX 3")
    ]


def test_swapped_lines_explain_missing_crossings():
    """The missing crossing at rest lies on one of the lines that are swapped according to the indentations."""
    taxel = int(np.flatnonzero(KIND.tx == 0)[0])
    response_faults = [make_fault("swapped lines", "TX 0 and TX 7")]
    assert merge_to_pairs([make_fault("missing crossing", f"taxel {taxel}")], response_faults) == [
        ("swapped lines", "TX 0 and TX 7")
    ]


def test_a_missing_crossing_is_not_also_a_dead_taxel():
    assert merge_to_pairs([make_fault("missing crossing", "taxel 5")], [make_fault("dead taxel", "taxel 5")]) == [
        ("missing crossing", "taxel 5")
    ]


def test_a_constant_taxel_is_dead_regardless_of_its_count():
    faults = [make_fault("missing crossing", "taxel 5"), make_fault("dead taxel", "taxel 5")]
    assert merge_to_pairs(faults, []) == [("dead taxel", "taxel 5")]
    assert merge_to_pairs(faults, None) == [("dead taxel", "taxel 5")]


def test_low_gain_explains_a_deviating_level_at_rest():
    """Arguments of `merge_to_pairs`: faults at rest, then faults found by indentations."""
    assert merge_to_pairs([make_fault("rest level", "board")], [make_fault("low gain", "board")]) == [
        ("low gain", "board")
    ]
    assert merge_to_pairs([make_fault("rest level", "board")], []) == [("rest level", "board")]


def test_a_short_at_rest_is_reported_only_if_indentations_show_a_fault_of_its_lines():
    """Arguments of `merge_to_pairs`: faults at rest, then faults found by indentations."""
    assert merge_to_pairs([make_fault("short", "TX 3 and TX 4")], []) == []
    assert merge_to_pairs([make_fault("short", "TX 3 and TX 4")], [make_fault("open line", "TX 3")])[0] == (
        "short",
        "TX 3 and TX 4",
    )


def test_a_board_with_equal_lines_passes_after_indentations():
    rng = np.random.default_rng(1)
    hardware = 4000.0 + 30.0 * np.sin(KIND.rx / 3.0)  # Lines that differ by less than their noise.
    rest_faults, _ = find_line_faults(measure_at_rest(KIND, hardware, rng), 0.6)
    assert {fault.name for fault in rest_faults} == {"short"}
    indentations = measure_indentations(KIND, sample_responses(KIND, rng), rng)
    assert merge_faults(KIND, rest_faults, find_response_faults(indentations, 0.4)) == []


def test_a_board_without_response_keeps_the_faults_at_rest():
    rest_faults = [make_fault("short", "TX 3 and TX 4"), make_fault("open line", "RX 2")]
    assert [name for name, _ in merge_to_pairs(rest_faults, [make_fault("no response", "board")])] == [
        "short",
        "open line",
        "no response",
    ]
