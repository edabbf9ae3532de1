"""Fixtures of the campaign tests: a workstation, a few cylinder grasps in two sessions, and a short timeline."""

import pytest

from taxel.campaign.setup import Setup
from taxel.grasp.plan import PlannedGrasp, make_thesis_plan
from taxel.grasp.timeline import Timeline

SHORT = Timeline(baseline_s=0.4, closing_s=1.2, hold_s=0.3, release_s=0.4, recovery_s=0.2)


@pytest.fixture(scope="session")
def setup() -> Setup:
    return Setup()


@pytest.fixture(scope="session")
def timeline() -> Timeline:
    return SHORT


@pytest.fixture(scope="session")
def plan() -> tuple[PlannedGrasp, ...]:
    """Return two grasps of the cylinder: the first one, other than from the top, in each of the sessions 0 and 1."""
    grasps = [planned for planned in make_thesis_plan(1) if planned.object == "cylinder" and planned.approach != "top"]
    return tuple(next(planned for planned in grasps if planned.session == session) for session in (0, 1))


@pytest.fixture(scope="session")
def two_of_one_session() -> tuple[PlannedGrasp, ...]:
    """Return the first two grasps of the cylinder in session 0."""
    grasps = [planned for planned in make_thesis_plan(1) if planned.object == "cylinder" and planned.session == 0]
    return tuple(grasps[:2])
