"""Random single instructions in the emulator and in Unicorn; `python tools/cortex/differential.py` runs more cases."""

import numpy as np
import pytest

SEED = 20261121
BLOCKS = 52
"""106,496 cases: every first halfword once, and 62 % of them twice."""


@pytest.fixture
def cpu(cortex):
    with cortex.bare_cpu.BareCpu(halt_on_fault=True) as cpu:
        yield cpu


def test_every_instruction_has_the_same_effect_as_in_unicorn(cortex, cpu, oracle):
    print(f"seed {SEED}")
    tally, first_halfwords = {}, set()
    for index in range(BLOCKS):
        block_tally, differences = cortex.differential.check_block(SEED, index, cpu, oracle)
        assert not differences, f"seed {SEED}, " + "\n".join(differences)
        first_halfwords |= set(cortex.cases.generate_block(SEED, index).first.tolist())
        for name, count in block_tally.items():
            tally[name] = tally.get(name, 0) + count
    print(tally)
    assert sum(tally.values()) == BLOCKS * cortex.cases.BLOCK >= 100_000
    assert len(first_halfwords) > 0.9 * 0x10000  # nearly every 16-bit code occurs as the first halfword
    for verdict in cortex.unicorn_oracle.Verdict:
        assert tally[verdict.name] > 300
    for deviation in cortex.deviations.KNOWN:
        assert tally[deviation.name] > 0, f"{deviation.name}: Unicorn no longer differs"


def test_a_difference_is_found_and_described(cortex, cpu, oracle):
    block = cortex.cases.generate_block(SEED, 0)
    outcome, is_equal = cortex.differential.run_block(block, cpu, oracle)
    assert is_equal
    different = cortex.differential.find_differences(outcome)
    case = int(np.flatnonzero(~different & (outcome.verdict == 0))[0])  # executed without a fault (Verdict.DONE)
    outcome.emulated["r"][case, 3] ^= 1
    assert cortex.differential.find_differences(outcome)[case]
    assert " r3 " in cortex.differential.describe(outcome, case)


def test_a_block_is_reproduced_by_its_seed_and_index(cortex):
    block, repeated = cortex.cases.generate_block(5, 3), cortex.cases.generate_block(5, 3)
    assert (block.first == repeated.first).all()
    assert (block.states == repeated.states).all()
    assert block.flash == repeated.flash
    assert (block.first != cortex.cases.generate_block(6, 3).first).any()
