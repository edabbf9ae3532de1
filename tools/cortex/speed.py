"""Instructions a second of the emulator's Cortex-M0, and of Unicorn on the same image.

python tools/cortex/speed.py              loops, tables, bytes and words, calls, multiplications (programs/speed.c)
python tools/cortex/speed.py --program firmware --optimise s     another program, compiled for size

Processor time of one core, median of the repeats. Unicorn runs the program in one call, and in slices of a thousand
and a hundred instructions, which is what it takes to stop it near a given time.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from bare_cpu import BareCpu, Reason
from images import Image, ImageError, ToolMissingError, UnicornRun, build_image, run_here
from unicorn_oracle import UnicornMissingError

SLICES = (0, 1000, 100)


def count_instructions(image: Image) -> int:
    """Instructions of the whole program, counted one by one."""
    with BareCpu() as cpu:
        cpu.load(0, image.binary)
        cpu.reset()
        count = 0
        while True:
            count += cpu.instructions(1 << 40)
            if cpu.state["r"][0, 0] != 4:
                return count
            cpu.skip()


def seconds(action: Callable[[], object], repeats: int) -> float:
    """Median processor time of `action`."""
    spent = []
    for _ in range(repeats):
        begin = time.process_time()
        action()
        spent.append(time.process_time() - begin)
    return statistics.median(spent)


def in_slices(cpu: BareCpu, image: Image, cycles: int) -> None:
    """The program on our processor, `cycles` a call."""
    cpu.load(0, image.binary)
    cpu.reset()
    while True:
        reason = cpu.run(cpu.cycle + cycles)
        if reason == Reason.BREAKPOINT:
            if cpu.state["r"][0, 0] != 4:
                return
            cpu.skip()


def in_unicorn(image: Image, size: int) -> str:
    """The program in a fresh Unicorn."""
    return UnicornRun(image).run(size)


def main() -> int:
    """Print the rates and their ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="speed", help="of tools/cortex/programs (default: speed)")
    parser.add_argument("--optimise", default="2", help="level that it is compiled with: 2, s (default: 2)")
    parser.add_argument("--repeats", type=int, default=5, help="(default: 5)")
    arguments = parser.parse_args()
    try:
        image = build_image(arguments.program, f"-O{arguments.optimise}")
        count = count_instructions(image)
        fast = run_here(image).cycles
        with BareCpu(flash_wait=1) as cpu:
            slow = run_here(image, cpu).cycles
        print(
            f"{image.name}: {count} instructions, {fast} cycles; {slow} with one wait state ({fast / slow:.0%} as fast)"
        )
        ours = count / seconds(lambda: run_here(image), arguments.repeats)
        print(f"here: {ours / 1e6:.0f} million instructions/s")
        with BareCpu() as cpu:
            ours_sliced = count / seconds(lambda: in_slices(cpu, image, 1000), arguments.repeats)
        print(f"here, 1000 cycles a call from Python: {ours_sliced / 1e6:.0f} million instructions/s")
        for size in SLICES:
            theirs = count / seconds(partial(in_unicorn, image, size), 1 if size else arguments.repeats)
            name = f"{size} instructions a call" if size else "in one call"
            print(f"Unicorn, {name}: {theirs / 1e6:.1f} million instructions/s; ratio {ours / theirs:.1f}")
    except (ToolMissingError, ImageError, UnicornMissingError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
