"""The errors of the arm: each prints as one line and carries its data."""

from taxel.errors import TaxelError


class ArmError(TaxelError):
    """The arm cannot do what was asked. `arm` names it, `problem` says why and what to do."""

    def __init__(self, arm: str, problem: str) -> None:
        # Both are args, so that the error survives pickling between processes.
        super().__init__(arm, problem)
        self.arm = arm
        self.problem = problem

    def __str__(self) -> str:
        return f"{self.arm}: {self.problem}"


class ArmLimitError(ArmError, ValueError):
    """A target or a speed outside the limits. The arm has not moved."""


class ArmBusyError(ArmError):
    """The arm is still moving. The motion goes on."""


class ArmConnectionError(ArmError):
    """The arm's controller cannot be reached, or refuses."""


class ArmPackageMissingError(ArmError):
    """An optional Python package that this arm needs is not installed."""
