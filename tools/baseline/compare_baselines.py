"""Compare baseline policies after a lasting contact with drift, `make compare-baselines`.

Example: python tools/baseline/compare_baselines.py --worlds 3 --seed 1
"""

from __future__ import annotations

import argparse
import json
import secrets
import sys
import time
from pathlib import Path

import numpy as np
from baseline_policies import ExponentialBaseline
from baseline_worlds import LastingContact, run_world

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.output import write_whole
from taxel.signal import BASELINE_SAMPLES, TrackedBaseline, compute_baseline
from taxel.types import FloatArray

HAND = "rig4"
AFTER_RELEASE_S = (5.0, 60.0)
"""Times after the release at which a baseline is compared, seconds."""
TRUE_S = 4.0
"""Time over which the run without contact is averaged to the true count, seconds; centred on the compared time."""

POLICIES = ("fixed mean of 100 samples", "exponential", "exponential, frozen in contact", "tracked")


def measure(world: LastingContact) -> tuple[dict[float, dict[str, FloatArray]], float]:
    """Measure the errors of all baselines in one world.

    Returns the absolute errors f64[n] of the baselines in counts, by time after the release (s) and name of the policy;
    and the processor time of the tracked baseline in seconds per hour of frames.
    """
    cycles = world.with_contact
    raw, times = cycles.raw_counts, cycles.time_s
    first = compute_baseline(raw[:BASELINE_SAMPLES])
    tracked = TrackedBaseline(first.mean, first.noise, world.board)
    exponential = [ExponentialBaseline(first.mean, freezes) for freezes in (False, True)]
    found: dict[float, dict[str, FloatArray]] = {}
    waiting = [world.end_s + after for after in AFTER_RELEASE_S]
    spent = 0.0
    valid = cycles.valid[:, world.board]
    for row in range(BASELINE_SAMPLES, len(times)):
        start = time.process_time()
        tracked.update(float(times[row]), raw[row], valid[row])
        spent += time.process_time() - start
        for policy in exponential:
            policy.update(float(times[row]), raw[row])
        if waiting and times[row] >= waiting[0]:
            after = waiting.pop(0)
            truth = world.without.between(after - TRUE_S / 2, after + TRUE_S / 2).raw_counts.mean(axis=0)
            means = (first.mean, exponential[0].mean, exponential[1].mean, tracked.state.mean)
            found[after - world.end_s] = {
                name: np.abs(mean - truth) for name, mean in zip(POLICIES, means, strict=True)
            }
    return found, 3600.0 * spent / float(times[-1] - times[BASELINE_SAMPLES])


def main() -> int:
    """Run the comparison, write its results and print the table. Returns the exit status: 1 after an error."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--worlds", type=int, default=5)
    parser.add_argument("--seed", type=int, help="default: random")
    parser.add_argument("--use-s", type=float, default=900.0, help="use before the lasting contact, seconds")
    parser.add_argument("--hold-s", type=float, default=3600.0, help="length of the lasting contact, seconds")
    parser.add_argument("--out", type=Path, default=Path("out/baseline"))
    options = parser.parse_args()
    seed = secrets.randbelow(2**31) if options.seed is None else options.seed
    print(f"seed {seed}, {options.worlds} worlds of {HAND}", flush=True)
    rows = []
    for number in range(options.worlds):
        try:
            world = run_world(load_hand(HAND), seed + number, options.use_s, options.hold_s)
        except TaxelError as error:
            print(f"error: world {seed + number}: {error}", file=sys.stderr)
            return 1
        errors, cpu_s = measure(world)
        rows.append({"seed": seed + number, "cpu_s_per_hour": cpu_s, "errors": _summarise(errors)})
        print(f"world {seed + number}: {cpu_s:.1f} s of CPU time per hour", flush=True)
    options.out.mkdir(parents=True, exist_ok=True)
    write_whole(options.out / "score.json", json.dumps(rows, indent=1))
    print(_format(rows))
    return 0


def _summarise(errors: dict[float, dict[str, FloatArray]]) -> dict[str, dict[str, list[float]]]:
    """Return [median, maximum] over the n taxels of the absolute errors, counts, by time after the release and policy.

    errors: f64[n], absolute errors in counts, by time after the release in seconds and by name of the policy (one of
    `POLICIES`). The times of the result are text for JSON, such as "60", in seconds.
    """
    return {
        f"{after:g}": {name: [float(np.median(value)), float(value.max())] for name, value in policies.items()}
        for after, policies in errors.items()
    }


def _format(rows: list[dict[str, object]]) -> str:
    """Format the table of the absolute errors, counts, with a row for each policy and two columns for each time.

    The columns are the median of the worlds' median errors and the largest error. rows: results of the worlds, as in
    score.json; the value of `errors` is the result of `_summarise`.
    """
    lines = [
        f"{'error of the baseline, counts':34s} "
        + "  ".join(f"{f'{after:g} s after':>20s}" for after in AFTER_RELEASE_S)
    ]
    lines.append(f"{'':34s} " + "  ".join(f"{'median':>10s}{'largest':>10s}" for _ in AFTER_RELEASE_S))
    for name in POLICIES:
        columns = []
        for after in AFTER_RELEASE_S:
            values = np.array([row["errors"][f"{after:g}"][name] for row in rows])  # type: ignore[index]
            columns.append(f"{np.median(values[:, 0]):10.1f}{values[:, 1].max():10.1f}")
        lines.append(f"{name:34s} " + "  ".join(columns))
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
