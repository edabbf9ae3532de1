"""Differential test of single instructions: registers, flags and memory of the emulator and of Unicorn must be equal.

    python tools/cortex/differential.py                            131,072 cases; prints the seed
    python tools/cortex/differential.py --cases 10000000 --jobs 2  more cases
    python tools/cortex/differential.py --seed 1 --first 77 --cases 2048     replays one block

Consecutive blocks contain all first halfwords in order. The exit status is 1 at the first block with a difference that
deviations.py does not list.
"""

import argparse
import multiprocessing
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parent))

from bare_cpu import RAM_BASE, BareCpu, Fault, Reason
from cases import BLOCK, Block, generate_block
from deviations import KNOWN, Outcome, clear_unimplemented_bits
from unicorn_oracle import FLASH_SIZE, RAM_SIZE, UnicornMissingError, UnicornOracle, Verdict

SVC = 0xDF
COMPARED = ("xpsr", "msp", "psp", "primask", "control")


def run_block(block: Block, cpu: BareCpu, oracle: UnicornOracle) -> tuple[Outcome, bool]:
    """Run a block in the emulator and in Unicorn. Returns the outcome, and whether the RAM contents are then equal."""
    for engine in (cpu.write_memory, oracle.write_memory):
        engine(0, block.flash)
        engine(RAM_BASE, block.ram)
    emulated, reference = block.states.copy(), block.states.copy()
    cpu.run_cases(emulated)
    verdict = np.array([oracle.run_case(reference[i : i + 1], int(block.size[i])) for i in range(len(reference))])
    clear_unimplemented_bits(reference)
    memory_equal = cpu.read_memory(RAM_BASE, RAM_SIZE) == oracle.read_memory(RAM_BASE, RAM_SIZE)
    return Outcome(block, emulated, reference, verdict), memory_equal


def get_emulated_verdict(outcome: Outcome) -> NDArray[np.int64]:
    """Return the emulator's result of each case as a value of `Verdict`, i64[n], to compare it with Unicorn's."""
    emulated = outcome.emulated
    verdict = np.full(len(emulated), int(Verdict.DONE))
    faulted = emulated["reason"] == Reason.FAULTED
    for fault, fault_verdict in (
        (Fault.UNDEFINED, Verdict.UNDEFINED),
        (Fault.UNALIGNED, Verdict.UNALIGNED),
        (Fault.BUS, Verdict.BUS),
        (Fault.SVC, Verdict.SVC),  # a masked SVC is a fault; Unicorn, without priorities, reports it as a normal SVC
    ):
        verdict[faulted & (emulated["fault"] == fault)] = fault_verdict
    verdict[emulated["reason"] == Reason.BREAKPOINT] = Verdict.BREAKPOINT
    verdict[(outcome.block.first >> 8 == SVC) & ~faulted] = Verdict.SVC
    return verdict


def find_differences(outcome: Outcome) -> NDArray[np.bool_]:
    """Return which test cases differ between the emulator and Unicorn, as bool[n].

    A case also counts as different if the emulator reports a fault and a register has changed.
    """
    emulated, reference, before = outcome.emulated, outcome.reference, outcome.block.states
    different = get_emulated_verdict(outcome) != outcome.verdict
    different |= (emulated["reason"] == Reason.FAULTED) & (emulated["r"] != before["r"]).any(1)
    completed = outcome.verdict == Verdict.DONE
    for name in COMPARED:
        different |= (emulated[name] != reference[name]) & completed
    different |= (emulated["r"] != reference["r"]).any(1) & completed
    return np.asarray(different, dtype=np.bool_)


def describe(outcome: Outcome, case: int) -> str:
    """Return one line with the instruction of a test case and the differences between the emulator and Unicorn."""
    emulated, reference = outcome.emulated[case], outcome.reference[case]
    first, second = outcome.block.first[case], outcome.block.second[case]
    parts = [f"{first:04x} {second:04x}:"]
    parts += [
        f"emulator {Verdict(int(get_emulated_verdict(outcome)[case])).name},",
        f"Unicorn {Verdict(outcome.verdict[case]).name}",
    ]
    for i in range(16):
        if emulated["r"][i] != reference["r"][i]:
            parts.append(
                f"r{i} {outcome.block.states[case]['r'][i]:08x} -> {emulated['r'][i]:08x}, {reference['r'][i]:08x};"
            )
    for name in COMPARED:
        if emulated[name] != reference[name]:
            parts.append(f"{name} {emulated[name]:08x}, {reference[name]:08x};")
    return " ".join(parts)


def find_first_memory_difference(block: Block, cpu: BareCpu, oracle: UnicornOracle) -> str:
    """Run a block case by case and describe in one line the first instruction after which the memories differ."""
    for engine in (cpu.write_memory, oracle.write_memory):
        engine(0, block.flash)
        engine(RAM_BASE, block.ram)
    for i in range(len(block.states)):
        emulated, reference = block.states[i : i + 1].copy(), block.states[i : i + 1].copy()
        cpu.run_cases(emulated)
        verdict = oracle.run_case(reference, int(block.size[i]))
        emulated_words = np.frombuffer(cpu.read_memory(RAM_BASE, RAM_SIZE), "<u4")
        reference_words = np.frombuffer(oracle.read_memory(RAM_BASE, RAM_SIZE), "<u4")
        different = np.flatnonzero(emulated_words != reference_words)
        if len(different):
            index = int(different[0])
            parts = (
                f"{block.first[i]:04x} {block.second[i]:04x}: Unicorn {verdict.name}, {len(different)} words differ,"
            )
            address = RAM_BASE + 4 * index
            return f"{parts} at {address:08x} {emulated_words[index]:08x}, {reference_words[index]:08x}"
    return "memory differs after the block, but not after single instructions"


def check_block(seed: int, index: int, cpu: BareCpu, oracle: UnicornOracle) -> tuple[Counter[str], list[str]]:
    """Compare one block. Returns the counts by verdict and deviation, and a line for each unexplained difference."""
    block = generate_block(seed, index)
    outcome, memory_equal = run_block(block, cpu, oracle)
    tally: Counter[str] = Counter()
    explained = np.zeros(BLOCK, bool)
    for deviation in KNOWN:
        cases = deviation.cases(outcome)
        tally[deviation.name] += int(cases.sum())
        explained |= cases
    for verdict in Verdict:
        tally[verdict.name] += int(((outcome.verdict == verdict) & ~explained).sum())
    lines = [describe(outcome, int(i)) for i in np.flatnonzero(find_differences(outcome) & ~explained)]
    if not memory_equal:
        lines.append(find_first_memory_difference(block, cpu, oracle))
    return tally, [f"block {index}: {line}" for line in lines]


def check_blocks(seed: int, first: int, blocks: int) -> tuple[Counter[str], list[str]]:
    """Compare consecutive blocks on two new processors, up to the first block with a difference.

    first: number of the first block. blocks: number of blocks. Returns the sum of the counts of `check_block`, and the
    lines of the block with a difference, or [].
    """
    tally: Counter[str] = Counter()
    with BareCpu(FLASH_SIZE, RAM_SIZE, halt_on_fault=True) as cpu, UnicornOracle() as oracle:
        for index in range(first, first + blocks):
            part, lines = check_block(seed, index, cpu, oracle)
            tally += part
            if lines:
                return tally, lines
    return tally, []


def _check_part(part: tuple[int, int, int]) -> tuple[Counter[str], list[str]]:
    """Call `check_blocks` with (seed, first block, number of blocks), in a worker process."""
    return check_blocks(*part)


def main() -> int:
    """Compare random instructions in the emulator and in Unicorn, and print the numbers of cases by result.

    The exit status is 0 without unexplained differences, 1 with one, and 2 if Unicorn is not installed.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--cases", type=int, default=64 * BLOCK, help="rounded up to blocks of 2,048 (default: 131,072)"
    )
    parser.add_argument("--seed", type=int, default=1, help="(default: 1)")
    parser.add_argument("--first", type=int, default=0, help="number of the first block")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    arguments = parser.parse_args()
    print(f"seed {arguments.seed}")
    end, chunk = arguments.first + -(-arguments.cases // BLOCK), 16
    ranges = [(arguments.seed, i, min(chunk, end - i)) for i in range(arguments.first, end, chunk)]
    tally: Counter[str] = Counter()
    begin = time.monotonic()
    try:
        with multiprocessing.Pool(arguments.jobs) as pool:
            for part, lines in pool.imap(_check_part, ranges):
                tally += part
                if lines:
                    print("\n".join(lines))
                    return 1
    except UnicornMissingError as error:
        print(error, file=sys.stderr)
        return 2
    cases = (end - arguments.first) * BLOCK
    print(f"{cases} cases, no unknown difference, {time.monotonic() - begin:.0f} s")
    print("compared: " + ", ".join(f"{tally[verdict.name]} {verdict.name.lower()}" for verdict in Verdict))
    for deviation in KNOWN:
        print(f"{tally[deviation.name]:8d} {deviation.name}: {deviation.reason}; Unicorn executes it")
    return 0


if __name__ == "__main__":
    sys.exit(main())
