"""Errors of motion planning; each message is one line."""

from taxel.errors import TaxelError


class MotionPlanningError(TaxelError):
    """Error: no collision-free motion; nothing has moved.

    Attributes: what (object and approach, or another name of the motion), problem (cause and remedy).
    """

    def __init__(self, what: str, problem: str) -> None:
        """Create the error of an infeasible motion. what: name of the motion. problem: cause and remedy."""
        super().__init__(what, problem)  # both are args, so that the error survives pickling between processes
        self.what = what
        self.problem = problem

    def _format_message(self) -> str:
        """Format the error as one line: name of the motion, cause, remedy."""
        return f"{self.what}: {self.problem}"


class StartPostureError(MotionPlanningError):
    """Error: arm and hand collide, or are outside the joint limits, before the motion."""


class UnreachablePoseError(MotionPlanningError):
    """Error: the arm cannot place the palm as the approach requires it."""


class BlockedPoseError(MotionPlanningError):
    """Error: every arm posture that reaches the pose of the approach collides, or its linear approach does."""


class NoPathError(MotionPlanningError):
    """Error: the search found no collision-free path between start and approach."""
