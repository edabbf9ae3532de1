"""Instructions per second of the emulated Cortex-M0 and of Unicorn on the same image.

    python tools/cortex/speed.py              loops, tables, bytes and words, calls, multiplications (programs/speed.c)
    python tools/cortex/speed.py --program firmware --optimise s     another program, compiled for size

The figures are processor time of one core, median of the repeats. Unicorn runs the program in one call, and in slices
of a thousand and a hundred instructions, which a caller needs to stop Unicorn near a given time.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from bare_cpu import BareCpu, Reason
from images import Image, ImageError, ToolMissingError, UnicornRun, build_image, run_emulator
from unicorn_oracle import UnicornMissingError

SLICES = (0, 1000, 100)


def count_instructions(image: Image) -> int:
    """Run the whole program in the emulator in single steps, and return the number of its instructions."""
    with BareCpu() as cpu:
        cpu.write_memory(0, image.binary)
        cpu.reset()
        count = 0
        while True:
            count += cpu.count_instructions(1 << 40)
            # A breakpoint is a call of the host: r0 is 4 for a text output, another value ends the program.
            if cpu.state["r"][0, 0] != 4:
                return count
            cpu.skip_breakpoint()


def measure_median_seconds(action: Callable[[], object], repeats: int) -> float:
    """Call `action` `repeats` times and return the median of its processor time in seconds."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        action()
        times.append(time.process_time() - begin)
    return statistics.median(times)


def run_in_slices(cpu: BareCpu, image: Image, cycles: int) -> None:
    """Run the program in the emulator to its end, with `cycles` cycles per call."""
    cpu.write_memory(0, image.binary)
    cpu.reset()
    while True:
        reason = cpu.run(cpu.cycle + cycles)
        if reason == Reason.BREAKPOINT:  # call of the host: r0 is 4 for a text output, another value ends the program
            if cpu.state["r"][0, 0] != 4:
                return
            cpu.skip_breakpoint()


def run_in_unicorn(image: Image, size: int) -> str:
    """Run the program in a new Unicorn engine and return its output.

    size: instructions per call; 0: all in one call.
    """
    return UnicornRun(image).run(size)


def main() -> int:
    """Measure and print the instructions per second of the emulator and of Unicorn, and their ratio.

    The exit status is 2 if the compiler or Unicorn is missing, or if the program cannot be compiled or does not end.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="speed", help="program of tools/cortex/programs (default: speed)")
    parser.add_argument("--optimise", default="2", help="optimisation level, 2 or s (default: 2)")
    parser.add_argument("--repeats", type=int, default=5, help="repetitions of each measurement (default: 5)")
    arguments = parser.parse_args()
    try:
        image = build_image(arguments.program, f"-O{arguments.optimise}")
        count = count_instructions(image)
        cycles = run_emulator(image).cycles
        with BareCpu(flash_wait=1) as cpu:
            waiting_cycles = run_emulator(image, cpu).cycles
        print(f"{image.name}: {count} instructions, {cycles} cycles")
        print(f"{waiting_cycles} cycles with one wait state ({cycles / waiting_cycles:.0%} of the speed)")
        emulated = count / measure_median_seconds(lambda: run_emulator(image), arguments.repeats)
        print(f"emulator: {emulated / 1e6:.0f} million instructions/s")
        with BareCpu() as cpu:
            sliced_rate = count / measure_median_seconds(lambda: run_in_slices(cpu, image, 1000), arguments.repeats)
        print(f"emulator, 1000 cycles per call from Python: {sliced_rate / 1e6:.0f} million instructions/s")
        for size in SLICES:
            reference = count / measure_median_seconds(
                partial(run_in_unicorn, image, size), 1 if size else arguments.repeats
            )
            name = f"{size} instructions per call" if size else "in one call"
            print(f"Unicorn, {name}: {reference / 1e6:.1f} million instructions/s; ratio {emulated / reference:.1f}")
    except (ToolMissingError, ImageError, UnicornMissingError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
