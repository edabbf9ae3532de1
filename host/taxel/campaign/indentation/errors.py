"""Errors of indentation campaigns."""

from __future__ import annotations

from taxel.errors import TaxelError


class EquilibriumError(TaxelError):
    """The object of an indentation has no usable equilibrium.

    problem: predicate with the object as subject, such as "meets no skin". indentation: id of the indentation.
    """

    def __init__(self, problem: str, indentation: str = "") -> None:
        """Create the error of an object without a usable equilibrium. problem: predicate of the message."""
        super().__init__(problem, indentation)

    def _format_message(self) -> str:
        """Format the error as one line with the indentation, the problem and the remedy."""
        problem, indentation = self.args
        where = f"indentation {indentation}" if indentation else "indentation"
        return f"{where}: the object {problem}; use another position, less force, or smaller offsets"

    def for_indentation(self, indentation: str) -> EquilibriumError:
        """Return the same error with the id of the indentation."""
        return EquilibriumError(self.args[0], indentation)


class IndentationPlanError(TaxelError, ValueError):
    """A design from which no plan of indentations can be sampled."""

    def __init__(self, field: str, expected: str, found: str) -> None:
        """Create the error of a value from which no indentation plan can be made. field: name of the value."""
        super().__init__(field, expected, found)

    def _format_message(self) -> str:
        """Format the error as one line with the field, its expected and found value, and the remedy."""
        field, expected, found = self.args
        return f"indentation plan: {field}: expected {expected}, found {found}; correct the value"
