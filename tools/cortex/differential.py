"""Single instructions, here and in Unicorn: registers, flags and memory must be the same.

python tools/cortex/differential.py                           131,072 cases, seed printed
python tools/cortex/differential.py --cases 10000000 --jobs 2 more of them
python tools/cortex/differential.py --seed 1 --first 77 --cases 2048     replays one block

Blocks in a row sweep all first halfwords. Exit status 1 at the first block with a difference that deviations.py does
not know.
"""

from __future__ import annotations

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
from cases import BLOCK, Block, draw_block
from deviations import KNOWN, Outcome, tidy
from unicorn_oracle import FLASH_SIZE, RAM_SIZE, UnicornMissingError, UnicornOracle, Verdict

SVC = 0xDF
COMPARED = ("xpsr", "msp", "psp", "primask", "control")


def run_block(block: Block, cpu: BareCpu, oracle: UnicornOracle) -> tuple[Outcome, bool]:
    """The block on both. Whether RAM is the same afterwards is the second part."""
    for engine in (cpu.load, oracle.write_memory):
        engine(0, block.flash)
        engine(RAM_BASE, block.ram)
    ours, theirs = block.states.copy(), block.states.copy()
    cpu.run_cases(ours)
    verdict = np.array([oracle.run_case(theirs[i : i + 1], int(block.size[i])) for i in range(len(theirs))])
    tidy(theirs)
    same = cpu.memory(RAM_BASE, RAM_SIZE) == oracle.read_memory(RAM_BASE, RAM_SIZE)
    return Outcome(block, ours, theirs, verdict), same


def our_verdict(outcome: Outcome) -> NDArray[np.int64]:
    """i64[n]: what we say became of each instruction, in the oracle's words."""
    ours = outcome.ours
    verdict = np.full(len(ours), int(Verdict.DONE))
    faulted = ours["reason"] == Reason.FAULTED
    for fault, word in (
        (Fault.UNDEFINED, Verdict.UNDEFINED),
        (Fault.UNALIGNED, Verdict.UNALIGNED),
        (Fault.BUS, Verdict.BUS),
        (Fault.SVC, Verdict.SVC),  # masked: Unicorn has no priorities
    ):
        verdict[faulted & (ours["fault"] == fault)] = word
    verdict[ours["reason"] == Reason.BREAKPOINT] = Verdict.BREAKPOINT
    verdict[(outcome.block.first >> 8 == SVC) & ~faulted] = Verdict.SVC
    return verdict


def differences(outcome: Outcome) -> NDArray[np.bool_]:
    """bool[n]: where the two disagree, or where one of our faults has left its mark on a register."""
    ours, theirs, before = outcome.ours, outcome.theirs, outcome.block.states
    different = our_verdict(outcome) != outcome.verdict
    different |= (ours["reason"] == Reason.FAULTED) & (ours["r"] != before["r"]).any(1)
    settled = outcome.verdict == Verdict.DONE
    for name in COMPARED:
        different |= (ours[name] != theirs[name]) & settled
    different |= (ours["r"] != theirs["r"]).any(1) & settled
    return np.asarray(different, dtype=np.bool_)


def describe(outcome: Outcome, case: int) -> str:
    """One line: the instruction, and what differs."""
    ours, theirs = outcome.ours[case], outcome.theirs[case]
    first, second = outcome.block.first[case], outcome.block.second[case]
    words = [f"{first:04x} {second:04x}:"]
    words += [f"we say {Verdict(int(our_verdict(outcome)[case])).name}, Unicorn {Verdict(outcome.verdict[case]).name}"]
    for i in range(16):
        if ours["r"][i] != theirs["r"][i]:
            words.append(f"r{i} {outcome.block.states[case]['r'][i]:08x} -> {ours['r'][i]:08x}, {theirs['r'][i]:08x};")
    for name in COMPARED:
        if ours[name] != theirs[name]:
            words.append(f"{name} {ours[name]:08x}, {theirs[name]:08x};")
    return " ".join(words)


def first_memory_difference(block: Block, cpu: BareCpu, oracle: UnicornOracle) -> str:
    """One line: the first instruction after which memory is not the same."""
    for engine in (cpu.load, oracle.write_memory):
        engine(0, block.flash)
        engine(RAM_BASE, block.ram)
    for i in range(len(block.states)):
        ours, theirs = block.states[i : i + 1].copy(), block.states[i : i + 1].copy()
        cpu.run_cases(ours)
        verdict = oracle.run_case(theirs, int(block.size[i]))
        here, there = (np.frombuffer(engine(RAM_BASE, RAM_SIZE), "<u4") for engine in (cpu.memory, oracle.read_memory))
        different = np.flatnonzero(here != there)
        if len(different):
            at = int(different[0])
            words = (
                f"{block.first[i]:04x} {block.second[i]:04x}: Unicorn {verdict.name}, {len(different)} words differ,"
            )
            return f"{words} at {RAM_BASE + 4 * at:08x} {here[at]:08x}, {there[at]:08x}"
    return "memory differs, but not one instruction at a time"


def check_block(seed: int, index: int, cpu: BareCpu, oracle: UnicornOracle) -> tuple[Counter[str], list[str]]:
    """What was counted, and a line for each difference that is not known."""
    block = draw_block(seed, index)
    outcome, same_memory = run_block(block, cpu, oracle)
    tally: Counter[str] = Counter()
    excused = np.zeros(BLOCK, bool)
    for deviation in KNOWN:
        cases = deviation.cases(outcome)
        tally[deviation.name] += int(cases.sum())
        excused |= cases
    for verdict in Verdict:
        tally[verdict.name] += int(((outcome.verdict == verdict) & ~excused).sum())
    lines = [describe(outcome, int(i)) for i in np.flatnonzero(differences(outcome) & ~excused)]
    if not same_memory:
        lines.append(first_memory_difference(block, cpu, oracle))
    return tally, [f"block {index}: {line}" for line in lines]


def check_range(seed: int, first: int, blocks: int) -> tuple[Counter[str], list[str]]:
    """Blocks in a row on two fresh processors, up to the first with a difference."""
    tally: Counter[str] = Counter()
    with BareCpu(FLASH_SIZE, RAM_SIZE, halt_on_fault=True) as cpu, UnicornOracle() as oracle:
        for index in range(first, first + blocks):
            part, lines = check_block(seed, index, cpu, oracle)
            tally += part
            if lines:
                return tally, lines
    return tally, []


def _check_one(part: tuple[int, int, int]) -> tuple[Counter[str], list[str]]:
    return check_range(*part)


def main() -> int:
    """Print what was counted."""
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
            for part, lines in pool.imap(_check_one, ranges):
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
