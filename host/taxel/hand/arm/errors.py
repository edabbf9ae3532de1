"""Errors of the arm; each message is one line."""

from taxel.errors import TaxelError


class ArmError(TaxelError):
    """Base class of the errors of an arm whose command failed.

    Attributes: arm (its name), problem (cause and remedy).
    """

    def __init__(self, arm: str, problem: str) -> None:
        """Create the error for a failed command; arm: name of the arm; problem: cause and remedy."""
        # Both are args, so that the error can be pickled.
        super().__init__(arm, problem)
        self.arm = arm
        self.problem = problem

    def _format_message(self) -> str:
        return f"{self.arm}: {self.problem}"


class ArmLimitError(ArmError, ValueError):
    """Error: target or speed outside the limits of the arm; the arm has not moved."""


class ArmBusyError(ArmError):
    """Error: the arm is still moving; the motion continues."""


class ArmConnectionError(ArmError):
    """Error: the controller of the arm is not reachable or rejects a command."""


class ArmPackageMissingError(ArmError):
    """Error: an optional Python package that this arm requires is not installed."""
