"""Fixtures of the planning tests: the original workstation, its planner, and an independent collision check."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

from taxel.campaign.setup import Setup
from taxel.grasp.plan import PlannedGrasp
from taxel.hand.arm.base import UPRIGHT_RAD
from taxel.planning.planner import MotionPlanner

FOLDER = str(Path(__file__).parents[3] / "tools" / "planning")


@pytest.fixture(scope="session")
def setup() -> Setup:
    return Setup()


@pytest.fixture(scope="session")
def planned() -> PlannedGrasp:
    return PlannedGrasp("s0_00_cylinder_side_1_0", "cylinder", "side_1", 0, 0)


@pytest.fixture(scope="session")
def planner(setup) -> MotionPlanner:
    return MotionPlanner(setup.kinematics.robot, setup.hand, setup.table_z_m)


@pytest.fixture(scope="session")
def upright(setup) -> np.ndarray:
    """Return the posture of the upright arm with the hand joints as near to 0 as their ranges permit, f64[22]."""
    robot = setup.kinematics.robot
    return np.r_[UPRIGHT_RAD, np.clip(np.zeros(16), robot.lower[6:], robot.upper[6:])]


@pytest.fixture(scope="session")
def independent(setup):
    """Create the independent collision check with Pinocchio and Coal; the cylinder is at its place."""
    sys.path.insert(0, FOLDER)
    try:
        module = importlib.import_module("independent_check")
    finally:
        sys.path.remove(FOLDER)
    pose = setup.object_pose("cylinder")
    return module.IndependentCheck(setup.kinematics.robot, setup.hand, setup.table_z_m, setup.objects["cylinder"], pose)
