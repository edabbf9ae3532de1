"""One list of faults out of counts at rest and presses: each named once."""

from __future__ import annotations

import numpy as np

from host.tests.bench.synthetic_boards import KINDS, at_rest, presses, responses
from taxel_tools.bench.analysis.at_rest import line_faults
from taxel_tools.bench.analysis.conclusion import conclude, taxels_of
from taxel_tools.bench.analysis.fault import Fault
from taxel_tools.bench.analysis.presses import press_faults

KIND = KINDS["palm"]


def fault(name, place, severity=2.0):
    return Fault(name, place, "", severity)


def named(at_rest_faults, pressed):
    return [(one.name, one.place) for one in conclude(KIND, at_rest_faults, pressed)]


def test_places_are_taxels():
    assert (taxels_of(KIND, "TX 3") == (KIND.tx == 3)).all()
    assert (taxels_of(KIND, "RX 1 and RX 10") == ((KIND.rx == 1) | (KIND.rx == 10))).all()
    assert np.flatnonzero(taxels_of(KIND, "taxel 17")).tolist() == [17]
    assert taxels_of(KIND, "board").all()


def test_without_presses_counts_at_rest_stand_the_gravest_first():
    faults = [fault("open line", "TX 3", 2.0), fault("open line", "RX 1", 5.0)]
    assert named(faults, None) == [("open line", "RX 1"), ("open line", "TX 3")]


def test_an_open_line_is_named_once_though_presses_see_it_too():
    assert named([fault("open line", "TX 3")], [fault("open line", "TX 3", 9.0)]) == [("open line", "TX 3")]


def test_a_press_tells_exchanged_lines_from_missing_crossings():
    taxel = int(np.flatnonzero(KIND.tx == 0)[0])
    pressed = [fault("swapped lines", "TX 0 and TX 7")]
    assert named([fault("missing crossing", f"taxel {taxel}")], pressed) == [("swapped lines", "TX 0 and TX 7")]


def test_a_missing_crossing_is_not_called_a_dead_taxel_as_well():
    assert named([fault("missing crossing", "taxel 5")], [fault("dead taxel", "taxel 5")]) == [
        ("missing crossing", "taxel 5")
    ]


def test_a_taxel_that_stands_still_is_dead_whatever_its_count_is():
    faults = [fault("missing crossing", "taxel 5"), fault("dead taxel", "taxel 5")]
    assert named(faults, []) == [("dead taxel", "taxel 5")]
    assert named(faults, None) == [("dead taxel", "taxel 5")]


def test_low_gain_explains_an_odd_level_at_rest():
    assert named([fault("rest level", "board")], [fault("low gain", "board")]) == [("low gain", "board")]
    assert named([fault("rest level", "board")], []) == [("rest level", "board")]


def test_a_short_that_presses_do_not_show_was_chance():
    assert named([fault("short", "TX 3 and TX 4")], []) == []
    assert named([fault("short", "TX 3 and TX 4")], [fault("open line", "TX 3")])[0] == ("short", "TX 3 and TX 4")


def test_a_very_even_board_passes_once_it_is_pressed():
    rng = np.random.default_rng(1)
    smooth = 4000.0 + 30.0 * np.sin(KIND.rx / 3.0)  # lines that differ by less than their noise
    rest, _ = line_faults(at_rest(KIND, smooth, rng), 0.6)
    assert {one.name for one in rest} == {"short"}
    assert conclude(KIND, rest, press_faults(presses(KIND, responses(KIND, rng), rng), 0.4)) == []


def test_a_board_that_does_not_answer_keeps_what_was_seen_at_rest():
    rest = [fault("short", "TX 3 and TX 4"), fault("open line", "RX 2")]
    assert [name for name, _ in named(rest, [fault("no response", "board")])] == ["short", "open line", "no response"]
