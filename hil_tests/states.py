"""Many runs of the stateful test in parallel: `python -m hil_tests.states --runs 20000` (`make fuzz-states`)."""

import argparse
import os
import secrets
import subprocess
import sys
import time
from pathlib import Path

REPOSITORY = Path(__file__).parent.parent
RUNS_PER_PROCESS = 500
"""Runs that one process performs with one seed; the seed replays all of them."""


def main() -> int:
    """Run several processes with random sequences of the state machine and print their seeds.

    Returns the exit status: 1 at the first failure, with the command that replays it, otherwise 0.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20000, help="runs of 50 steps (20000)")
    parser.add_argument("--seed", type=int, default=None, help="seed of the first process (default: a new seed)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="parallel processes (all cores)")
    options = parser.parse_args()
    first_seed = secrets.randbelow(2**31) if options.seed is None else options.seed
    count = -(-options.runs // RUNS_PER_PROCESS)
    waiting = [(first_seed + i, min(RUNS_PER_PROCESS, options.runs - RUNS_PER_PROCESS * i)) for i in range(count)]
    print(f"{options.runs} runs, {count} processes, seeds {first_seed} to {first_seed + count - 1}", flush=True)
    start_s, n_done = time.monotonic(), 0
    running: list[tuple[int, int, subprocess.Popen[str]]] = []
    try:
        while waiting or running:
            while waiting and len(running) < options.jobs:
                running.append((*waiting[0], _start(*waiting.pop(0))))
            seed, runs, process = running.pop(0)
            output, _ = process.communicate()
            if process.returncode:
                replay = f"TAXEL_STATE_SEED={seed} TAXEL_STATE_RUNS={runs} pytest hil_tests/test_hil_states.py"
                print(f"\n{output}\nfailed; replay with: {replay}")
                return 1
            n_done += runs
            print(f"\r{n_done} of {options.runs} runs, {time.monotonic() - start_s:.0f} s", end="", flush=True)
    finally:
        for _, _, process in running:
            process.terminate()
            process.wait()
    print(f"\n{n_done} runs of 50 steps in {time.monotonic() - start_s:.0f} s: passed")
    return 0


def _start(seed: int, runs: int) -> subprocess.Popen[str]:
    """Start a pytest process with `runs` random sequences of the state machine test, sampled from `seed`."""
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
