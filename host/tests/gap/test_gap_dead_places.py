"""Silent taxels: dead ones in patches and on lines, and those that the object does not reach."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from taxel.gap.effects.dead_places import answers_elsewhere, is_evident, lines_of, patches

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
    """f64[n] with other values at places such as t2r3."""
    result = np.full((SIZE, SIZE), float(default))
    for name, value in places.items():
        result[int(name[1]), int(name[3])] = value
    return result.ravel()


def found(answer, expected):
    """Dead taxels as pairs, whether that is evident, and lines."""
    mute = answer < 0.2
    dead, evident = patches(STATE, answer, mute, np.atleast_2d(expected))
    lines = lines_of(STATE, dead, ALL)
    evident = evident or any(is_evident(STATE, answer, line) for line in lines)
    return {divmod(int(k), SIZE) for k in np.flatnonzero(dead)}, evident, lines


def test_a_dead_patch_with_weakly_loaded_taxels_is_found_completely_and_is_not_a_line():
    patch = {"t0r4": 0.0, "t0r5": 0.0, "t1r4": 0.0, "t1r5": 0.0}
    dead, evident, lines = found(grid(1.0, **patch), grid(500.0, t0r4=60.0, t1r5=50.0))
    assert dead == {(0, 4), (0, 5), (1, 4), (1, 5)}
    assert evident
    assert lines == []


def test_a_single_weakly_loaded_taxel_is_not_reported_as_dead():
    assert found(grid(1.0, t2r2=0.0), grid(500.0, t2r2=60.0))[0] == set()


def test_missing_signal_at_a_contact_rim_needs_two_conditions():
    rim = grid(1.0, t0r5=0.0, t1r5=0.0, t0r4=0.35, t1r4=0.4)
    assert found(rim, grid(300.0))[0] == set()
    assert found(rim, np.stack([grid(300.0), grid(300.0)]))[0] == {(0, 5), (1, 5)}


def test_one_condition_suffices_if_neighbouring_taxels_respond_fully():
    dead, evident, _ = found(grid(1.0, t0r5=0.0, t1r5=0.0), grid(300.0))
    assert dead == {(0, 5), (1, 5)}
    assert not evident


def test_a_dead_edge_line_is_evident_only_beside_a_fully_responding_line():
    last = {f"t{tx}r5": 0.0 for tx in range(SIZE)}
    _, evident, lines = found(grid(1.0, **last), grid(300.0))
    assert lines == [(0, "rx", 5)]
    assert evident
    faint = last | {f"t{tx}r4": 0.6 for tx in range(SIZE)}
    assert not found(grid(1.0, **faint), np.stack([grid(300.0), grid(300.0)]))[1]


def test_a_dead_line_with_a_dead_neighbour_taxel_is_reported_as_a_line():
    _, _, lines = found(grid(1.0, **{f"t3r{rx}": 0.0 for rx in range(SIZE)}, t4r0=0.0), grid(300.0))
    assert lines == [(0, "tx", 3)]


def test_a_dead_patch_over_two_lines_is_not_taken_for_exchanged_lines():
    """A dead patch over two lines that are pressed much alike; beyond it the second one shows what both should."""
    patch = {f"t{tx}r{rx}": 0.0 for tx in (1, 2) for rx in (1, 2)}
    expected = grid(0.0, t1r1=200.0, t1r2=190.0, t1r4=700.0, t2r1=500.0, t2r2=480.0, t2r4=690.0)
    seen = np.where(grid(1.0, **patch) == 0.0, 0.0, expected)
    mute = (seen == 0.0) & (expected > 0.0)
    state = SimpleNamespace(layout=SimpleNamespace(bins=1), pair=STATE.pair)
    real = SimpleNamespace(value=seen[None, None, None])
    arguments = (state, real, expected[None, None], (0, "tx", 1))
    assert not answers_elsewhere(*arguments, mute)
    assert answers_elsewhere(*arguments, np.zeros_like(mute))
    swapped = np.where(PLACE // SIZE == 1, expected.reshape(SIZE, SIZE)[3][PLACE % SIZE], 0.0)
    swapped = np.where(PLACE // SIZE == 3, expected.reshape(SIZE, SIZE)[1][PLACE % SIZE], swapped)
    real = SimpleNamespace(value=swapped[None, None, None])
    assert answers_elsewhere(state, real, expected[None, None], (0, "tx", 1), (swapped == 0.0) & (expected > 0.0))
