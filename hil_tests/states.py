"""Many runs of the state machine: `python -m hil_tests.states --runs 20000` (`make fuzz-states`)."""

import argparse
import os
import secrets
import subprocess
import sys
import time
from pathlib import Path

REPOSITORY = Path(__file__).parent.parent
PART = 500
"""Runs of one process: a seed replays so many."""


def main() -> int:
    """Run the parts, print their seeds. Exit status 1, and hypothesis's own report, for the first that fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20000, help="runs of 50 steps (20000)")
    parser.add_argument("--seed", type=int, default=None, help="of the first part (default: a new one)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="processes (all cores)")
    options = parser.parse_args()
    first = secrets.randbelow(2**31) if options.seed is None else options.seed
    parts = [(first + i, min(PART, options.runs - PART * i)) for i in range(-(-options.runs // PART))]
    print(f"{options.runs} runs, {len(parts)} parts, seeds {first} to {first + len(parts) - 1}", flush=True)
    begun_s, done = time.monotonic(), 0
    running: list[tuple[int, int, subprocess.Popen[str]]] = []
    try:
        while parts or running:
            while parts and len(running) < options.jobs:
                running.append((*parts[0], _start(*parts.pop(0))))
            seed, runs, process = running.pop(0)
            text, _ = process.communicate()
            if process.returncode:
                replay = f"TAXEL_STATE_SEED={seed} TAXEL_STATE_RUNS={runs} pytest hil_tests/test_hil_states.py"
                print(f"\n{text}\nfailed; to see it again: {replay}")
                return 1
            done += runs
            print(f"\r{done} of {options.runs} runs, {time.monotonic() - begun_s:.0f} s", end="", flush=True)
    finally:
        for _, _, process in running:
            process.terminate()
            process.wait()
    print(f"\n{done} runs of 50 steps in {time.monotonic() - begun_s:.0f} s: no finding")
    return 0


def _start(seed: int, runs: int) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "hil_tests/test_hil_states.py"],
        cwd=REPOSITORY,
        env=os.environ | {"TAXEL_STATE_SEED": str(seed), "TAXEL_STATE_RUNS": str(runs)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


if __name__ == "__main__":
    sys.exit(main())
