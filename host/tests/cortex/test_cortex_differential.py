"""Random single instructions, here and in Unicorn; more of them by python tools/cortex/differential.py."""

import numpy as np
import pytest

SEED = 20261121
BLOCKS = 52
"""106,496 cases: every first halfword once, and half of them twice."""


@pytest.fixture
def cpu(cortex):
    with cortex.bare_cpu.BareCpu(halt_on_fault=True) as cpu:
        yield cpu


def test_every_instruction_does_what_unicorn_does(cortex, cpu, oracle):
    print(f"seed {SEED}")
    tally, first = {}, set()
    for index in range(BLOCKS):
        part, lines = cortex.differential.check_block(SEED, index, cpu, oracle)
        assert not lines, f"seed {SEED}, " + "\n".join(lines)
        first |= set(cortex.cases.draw_block(SEED, index).first.tolist())
        for name, count in part.items():
            tally[name] = tally.get(name, 0) + count
    print(tally)
    assert sum(tally.values()) == BLOCKS * cortex.cases.BLOCK >= 100_000
    assert len(first) > 0.9 * 0x10000
    for verdict in cortex.unicorn_oracle.Verdict:
        assert tally[verdict.name] > 300
    for deviation in cortex.deviations.KNOWN:
        assert tally[deviation.name] > 0, f"{deviation.name}: Unicorn no longer differs"


def test_a_difference_is_found_and_described(cortex, cpu, oracle):
    block = cortex.cases.draw_block(SEED, 0)
    outcome, same = cortex.differential.run_block(block, cpu, oracle)
    assert same
    clean = cortex.differential.differences(outcome)
    case = int(np.flatnonzero(~clean & (outcome.verdict == 0))[0])
    outcome.ours["r"][case, 3] ^= 1
    assert cortex.differential.differences(outcome)[case]
    assert " r3 " in cortex.differential.describe(outcome, case)


def test_blocks_are_the_same_whenever_they_are_drawn(cortex):
    once, again = cortex.cases.draw_block(5, 3), cortex.cases.draw_block(5, 3)
    assert (once.first == again.first).all()
    assert (once.states == again.states).all()
    assert once.flash == again.flash
    assert (once.first != cortex.cases.draw_block(6, 3).first).any()
