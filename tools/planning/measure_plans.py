"""Measure the motion planner on random starts, objects and poses: success, time, independently found collisions.

Problem k is sampled from the seed and k alone, so `--first K --problems 1` repeats it.
"""

import argparse
import functools
import json
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from independent_check import IndependentCheck

from taxel.campaign.setup import Setup
from taxel.grasp.plan import ITERATIONS, PlannedGrasp
from taxel.hand import load_hand
from taxel.hand.transforms import make_pose
from taxel.output import AppendedLines, read_complete_lines
from taxel.planning.clearance import Clearances
from taxel.planning.errors import MotionPlanningError
from taxel.planning.plan import MotionPlan
from taxel.planning.planner import CONTACT_DEPTH_M, START_CLEARANCE_M, MotionPlanner
from taxel.types import FloatArray

RADIUS_M = (0.35, 0.80)
"""Range of the object's distance from the axis of the arm's base, metres; the arm reaches 0.85 m with its flange."""

HEIGHT_M = (0.0, 0.20)
"""Range of the object's height above the table, metres."""

DEPTH_TOLERANCE_M = 0.0005
"""Overlap of hand and object beyond the contact depth that the planner excludes between its samples, metres."""

SPEED_TOLERANCE = 1.0 + 1e-6


@dataclass
class Result:
    """Result of one problem. outcome: "accepted" or the class of the error. overlap: violation; "": none.

    rejected_starts: random start postures in collision that were sampled before the free one. message: of the error.
    """

    problem: int
    object: str
    approach: str
    outcome: str
    plan_s: float
    motion_s: float
    waypoints: int
    rejected_starts: int
    overlap: str
    message: str


@functools.lru_cache(maxsize=1)
def make_setup(hand_name: str) -> Setup:
    """Create the workstation of a packaged hand."""
    return Setup(load_hand(hand_name))


def solve_problem(hand_name: str, seed: int, problem: int) -> Result:
    """Sample the problem number `problem`, plan it, and check the plan."""
    setup, rng = make_setup(hand_name), np.random.default_rng([seed, problem])
    keys = sorted(ITERATIONS)
    name, approach_name = keys[rng.integers(len(keys))]
    pose = sample_object_pose(rng, setup.table_z_m)
    item = setup.objects[name]
    planned = PlannedGrasp(f"problem {problem}", name, approach_name, 0, 0)
    approach = setup.approach(planned)
    planner = MotionPlanner(setup.kinematics.robot, setup.hand, setup.table_z_m)
    start, rejected = sample_free_start(rng, planner, planner.get_clearances(item, pose))
    begin = time.process_time()
    try:
        plan = planner.plan(f"object {name}, approach {approach_name}", item, pose, approach, start)
    except MotionPlanningError as error:
        elapsed = time.process_time() - begin
        return Result(problem, name, approach_name, type(error).__name__, elapsed, 0.0, 0, rejected, "", str(error))
    elapsed = time.process_time() - begin
    check = IndependentCheck(setup.kinematics.robot, setup.hand, setup.table_z_m, item, pose)
    problem_text = find_violation(plan, planner, check, (setup.hand.layer_m or 0.0) + CONTACT_DEPTH_M)
    return Result(
        problem, name, approach_name, "accepted", elapsed, plan.duration_s, len(plan.waypoints), rejected,
        problem_text, "",
    )  # fmt: skip


def sample_object_pose(rng: np.random.Generator, table_z_m: float) -> FloatArray:
    """Return a random pose f64[4, 4] of a standing object, in any direction from the base and with any yaw."""
    radius, direction, yaw = rng.uniform(*RADIUS_M), rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi)
    position = [radius * np.cos(direction), radius * np.sin(direction), table_z_m + rng.uniform(*HEIGHT_M)]
    return make_pose(position, [np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])


def sample_free_start(
    rng: np.random.Generator, planner: MotionPlanner, clearances: Clearances
) -> tuple[FloatArray, int]:
    """Return a random start posture f64[j] in which the planner finds no collision, and the number of rejected ones."""
    lower, upper = np.maximum(planner.robot.lower, -np.pi), np.minimum(planner.robot.upper, np.pi)
    required = np.full(len(clearances.all_pairs), START_CLEARANCE_M)
    rejected = 0
    while True:
        start = rng.uniform(lower, upper)
        if clearances.find_collision(start, required) is None:
            return start, rejected
        rejected += 1


def find_violation(plan: MotionPlan, planner: MotionPlanner, check: IndependentCheck, depth_m: float) -> str:
    """Return the first overlap, joint limit or speed limit that a plan violates, as a text; "" if it violates none.

    depth_m: depth to which hand and object may overlap when the object is grasped, metres.
    """
    overlap = check.find_overlap_on_path(plan.waypoints)
    if overlap is not None:
        return f"path: {overlap}"
    overlap = check.find_overlap_on_path(np.stack([plan.pregrasp, plan.grasping]), depth_m + DEPTH_TOLERANCE_M)
    if overlap is not None:
        return f"approach: {overlap}"
    postures = np.vstack([plan.waypoints, plan.grasping])
    if (postures < planner.robot.lower - 1e-9).any() or (postures > planner.robot.upper + 1e-9).any():
        return "a joint limit"
    speed, _ = plan.limits.get_joint_limits(postures.shape[1])
    times = np.arange(0.0, plan.path.duration_s, 0.01)
    if len(times) > 1 and (np.abs(np.diff(plan.path.sample(times), axis=0)) / 0.01 > speed * SPEED_TOLERANCE).any():
        return "a speed limit"
    return ""


def summarise(results: list[Result]) -> dict[str, object]:
    """Return the numbers of outcomes and of plans with a violation, the success rate and the times, as JSON values.

    The success rate is the share of accepted plans among the problems with a reachable goal that is free of collisions:
    accepted plans, and failed searches for a path (`NoPathError`). It is None without such a problem.
    """
    accepted = [result for result in results if result.outcome == "accepted"]
    outcomes = Counter(result.outcome for result in results)
    feasible = len(accepted) + outcomes["NoPathError"]
    times = np.array([result.plan_s for result in accepted]) if accepted else np.zeros(1)
    return {
        "problems": len(results),
        "outcomes": dict(outcomes),
        "accepted_in_collision_or_beyond_limits": sum(bool(result.overlap) for result in accepted),
        "success_rate_of_free_goals": len(accepted) / feasible if feasible else None,
        "plan_s_median": float(np.median(times)),
        "plan_s_95": float(np.quantile(times, 0.95)),
        "plan_s_max": float(times.max()),
        "motion_s_median": float(np.median([result.motion_s for result in accepted] or [0.0])),
        "waypoints_median": float(np.median([result.waypoints for result in accepted] or [0])),
        "rejected_starts": sum(result.rejected_starts for result in results),
    }


def read_results(path: Path) -> dict[int, Result]:
    """Read the results of an interrupted measurement, by number of the problem."""
    results = [Result(**json.loads(line)) for line in read_complete_lines(path)]
    return {result.problem: result for result in results}


def main() -> int:
    """Run the problems and print the summary; the exit status is 1 if an accepted plan has a violation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0, help="number of the first problem")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--hand", default="original", help="original or allegro")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, help="file of all results, one JSON object a line; continued if it exists")
    options = parser.parse_args()
    results = read_results(options.out) if options.out is not None and options.out.exists() else {}
    numbers = [k for k in range(options.first, options.first + options.problems) if k not in results]
    solve = functools.partial(solve_problem, options.hand, options.seed)
    with ProcessPoolExecutor(options.jobs) as pool:
        for result in pool.map(solve, numbers, chunksize=1):
            results[result.problem] = result
            if options.out is not None:
                with AppendedLines(options.out) as lines:
                    lines.append(json.dumps(asdict(result)))
    summary = summarise(list(results.values()))
    for result in results.values():
        if result.overlap:
            print(f"problem {result.problem}: {result.object}, {result.approach}: {result.overlap}")
    print(json.dumps(summary, indent=1))
    return 1 if summary["accepted_in_collision_or_beyond_limits"] else 0


if __name__ == "__main__":
    sys.exit(main())
