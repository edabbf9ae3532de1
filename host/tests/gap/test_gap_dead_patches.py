"""Taxels without a signal: dead patches, dead lines, and taxels that the object does not touch."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from taxel.gap.effects.dead_taxels import find_dead_lines, find_dead_taxels, is_line_evident, is_response_on_other_line

SIZE = 6
PLACE = np.arange(SIZE * SIZE)
STATE = SimpleNamespace(
    pair=SimpleNamespace(
        n=SIZE * SIZE,
        groups=SimpleNamespace(sensor=np.zeros(SIZE * SIZE, int)),
        taxels=SimpleNamespace(tx=PLACE // SIZE, rx=PLACE % SIZE),
    )
)
ALL = np.ones(SIZE * SIZE, bool)


def grid(default, **places):
    """Return f64[36] with a default value, and other values at places such as t2r3 (TX line 2, RX line 3)."""
    result = np.full((SIZE, SIZE), float(default))
    for name, value in places.items():
        result[int(name[1]), int(name[3])] = value
    return result.ravel()


def find_dead(response, expected):
    """Return the dead taxels as (TX, RX), whether a dead patch or line is evident, and the dead lines.

    response: measured divided by expected signal, f64[36]. expected: expected signal in counts, f64[36], or f64[C, 36]
    for C conditions.
    """
    is_silent = response < 0.2
    dead, evident = find_dead_taxels(STATE, response, is_silent, np.atleast_2d(expected))
    lines = find_dead_lines(STATE, dead, ALL)
    evident = evident or any(is_line_evident(STATE, response, line) for line in lines)
    return {divmod(int(k), SIZE) for k in np.flatnonzero(dead)}, evident, lines


def test_a_dead_patch_with_weakly_loaded_taxels_is_found_completely_and_is_not_a_line():
    """The first grid has the measured signal relative to the expected one (1.0: healthy); t0r4 is TX line 0, RX line 4.

    The second grid has the expected signal in counts, which is small on two taxels of the patch.
    """
    patch = {"t0r4": 0.0, "t0r5": 0.0, "t1r4": 0.0, "t1r5": 0.0}
    dead, evident, lines = find_dead(grid(1.0, **patch), grid(500.0, t0r4=60.0, t1r5=50.0))
    assert dead == {(0, 4), (0, 5), (1, 4), (1, 5)}
    assert evident
    assert lines == []


def test_a_single_weakly_loaded_taxel_is_not_reported_as_dead():
    assert find_dead(grid(1.0, t2r2=0.0), grid(500.0, t2r2=60.0))[0] == set()


def test_missing_signal_at_a_contact_rim_needs_two_conditions():
    rim = grid(1.0, t0r5=0.0, t1r5=0.0, t0r4=0.35, t1r4=0.4)
    assert find_dead(rim, grid(300.0))[0] == set()
    assert find_dead(rim, np.stack([grid(300.0), grid(300.0)]))[0] == {(0, 5), (1, 5)}


def test_one_condition_suffices_if_neighbouring_taxels_respond_fully():
    dead, evident, _ = find_dead(grid(1.0, t0r5=0.0, t1r5=0.0), grid(300.0))
    assert dead == {(0, 5), (1, 5)}
    assert not evident


def test_a_dead_edge_line_is_evident_only_beside_a_fully_responding_line():
    """The grids have the measured signal relative to the expected one, and the expected signal in counts."""
    last_line = {f"t{tx}r5": 0.0 for tx in range(SIZE)}
    _, evident, lines = find_dead(grid(1.0, **last_line), grid(300.0))
    assert lines == [(0, "rx", 5)]
    assert evident
    weak = last_line | {f"t{tx}r4": 0.6 for tx in range(SIZE)}
    assert not find_dead(grid(1.0, **weak), np.stack([grid(300.0), grid(300.0)]))[1]


def test_a_dead_line_with_a_dead_neighbour_taxel_is_reported_as_a_line():
    _, _, lines = find_dead(grid(1.0, **{f"t3r{rx}": 0.0 for rx in range(SIZE)}, t4r0=0.0), grid(300.0))
    assert lines == [(0, "tx", 3)]


def test_exchanged_lines_are_distinguished_from_a_dead_patch_over_two_lines():
    """Both lines have similar loads inside the patch; outside it, the second line has the expected signal."""
    patch = {f"t{tx}r{rx}": 0.0 for tx in (1, 2) for rx in (1, 2)}
    expected = grid(0.0, t1r1=200.0, t1r2=190.0, t1r4=700.0, t2r1=500.0, t2r2=480.0, t2r4=690.0)
    measured = np.where(grid(1.0, **patch) == 0.0, 0.0, expected)
    is_silent = (measured == 0.0) & (expected > 0.0)
    state = SimpleNamespace(layout=SimpleNamespace(bins=1), pair=STATE.pair)
    real = SimpleNamespace(value=measured[None, None, None])
    arguments = (state, real, expected[None, None], (0, "tx", 1))
    assert not is_response_on_other_line(*arguments, is_silent)
    # If the silent taxels were compared, too, the lines would be taken for exchanged lines.
    assert is_response_on_other_line(*arguments, np.zeros_like(is_silent))
    # TX line 1 has the signals of TX line 3, and vice versa.
    exchanged = np.where(PLACE // SIZE == 1, expected.reshape(SIZE, SIZE)[3][PLACE % SIZE], 0.0)
    exchanged = np.where(PLACE // SIZE == 3, expected.reshape(SIZE, SIZE)[1][PLACE % SIZE], exchanged)
    real = SimpleNamespace(value=exchanged[None, None, None])
    assert is_response_on_other_line(
        state, real, expected[None, None], (0, "tx", 1), (exchanged == 0.0) & (expected > 0.0)
    )
