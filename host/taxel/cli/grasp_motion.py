"""`taxel grasp --check-motion`: plan the motions of a physical campaign without hardware."""

import json
import math
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from taxel.campaign.planned_motion import CampaignPlanner, PlannedMotion
from taxel.campaign.setup import Setup
from taxel.errors import TaxelError
from taxel.grasp.plan import PlannedGrasp
from taxel.hand.arm.base import ARM_JOINT_NAMES, UPRIGHT_RAD
from taxel.types import FloatArray


def check_motions(
    setup: Setup, grasps: Sequence[PlannedGrasp], source: str, is_requested: bool, arm_start: str | None, as_json: bool
) -> None:
    """Plan the motions of all grasps in their order, and print one table row for each, or a JSON list.

    source, is_requested, arm_start: values of the options --source, --check-motion and --arm-start. Raises TaxelError
    for wrong options, and after the output if a motion is infeasible. At least one of --check-motion and --arm-start
    must be given.
    """
    if not is_requested:
        raise TaxelError("--arm-start: expected --check-motion, found none; a physical arm reports its own start")
    if source != "physical":
        raise TaxelError(f"--check-motion: expected --source physical, found --source {source}")
    start = np.r_[_parse_angles(arm_start), _make_relaxed_hand(setup)]
    motions = list(CampaignPlanner(setup).plan_campaign(grasps, start))
    if as_json:
        print(json.dumps([_convert_to_json(motion) for motion in motions]))
    else:
        _print_table(motions)
    infeasible = [motion.error for motion in motions if motion.error is not None]
    if infeasible:
        others = f"; {len(infeasible) - 1} more of {len(motions)} motions are infeasible" if len(infeasible) > 1 else ""
        raise TaxelError(f"{infeasible[0]}{others}")


def _parse_angles(text: str | None) -> FloatArray:
    """Return the start angles of the arm, f64[6], radians, from the option --arm-start; None: the upright arm.

    text: six angles in degrees, separated by commas. Raises TaxelError for another text.
    """
    if text is None:
        return np.array(UPRIGHT_RAD)
    try:
        angles = [math.radians(float(part)) for part in text.split(",")]
    except ValueError:
        angles = []
    if len(angles) != len(ARM_JOINT_NAMES) or not all(math.isfinite(angle) for angle in angles):
        raise TaxelError(f"--arm-start: expected six angles in degrees such as 0,-90,0,-90,0,0, found '{text}'")
    return np.array(angles)


def _make_relaxed_hand(setup: Setup) -> FloatArray:
    """Return the hand's joint angles at the start, f64[16], radians: the permitted angle nearest to 0 of each joint."""
    robot, arm = setup.kinematics.robot, len(ARM_JOINT_NAMES)
    return np.clip(np.zeros(len(robot.joint_names) - arm), robot.lower[arm:], robot.upper[arm:])


def _convert_to_json(motion: PlannedMotion) -> dict[str, object]:
    """Return a planned motion as JSON values; waypoints, duration or error are None where they do not exist."""
    grasp, plan = motion.planned, motion.plan
    return {
        "id": grasp.id,
        "object": grasp.object,
        "approach": grasp.approach,
        "feasible": plan is not None,
        "waypoints_rad": None if plan is None else [*plan.waypoints.tolist(), plan.grasping.tolist()],
        "duration_s": None if plan is None else plan.duration_s,
        "error": None if motion.error is None else str(motion.error),
    }


def _print_table(motions: Sequence[PlannedMotion]) -> None:
    """Print a table with grasp, number of waypoints, duration and result of each motion.

    The result is "free" for a motion without collision, else the first part of the error.
    """
    table = Table(title="planned motions of arm and hand")
    for heading in ("grasp", "object", "approach", "waypoints", "duration, s", "result"):
        table.add_column(heading, justify="right" if heading in {"waypoints", "duration, s"} else "left")
    for motion in motions:
        grasp, plan = motion.planned, motion.plan
        numbers = ("", "") if plan is None else (str(len(plan.waypoints) + 1), f"{plan.duration_s:.1f}")
        result = "free" if motion.error is None else motion.error.problem.split(":")[0]
        table.add_row(
            grasp.id.split("_")[0] + "_" + grasp.id.split("_")[1], grasp.object, grasp.approach, *numbers, result
        )
    Console(markup=False).print(table)
