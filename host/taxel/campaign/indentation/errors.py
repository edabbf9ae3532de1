"""Errors of indentation campaigns."""

from __future__ import annotations

from taxel.errors import TaxelError


class EquilibriumError(TaxelError):
    """An indentation without equilibrium.

    problem: predicate with the object as subject, such as "meets no skin". indentation: id of the indentation.
    """

    def __init__(self, problem: str, indentation: str = "") -> None:
        super().__init__(problem, indentation)

    def __str__(self) -> str:
        problem, indentation = self.args
        where = f"indentation {indentation}" if indentation else "indentation"
        return f"{where}: the object {problem}; use another position, less force, or smaller offsets"

    def for_indentation(self, indentation: str) -> EquilibriumError:
        """The same error with the id of the indentation."""
        return EquilibriumError(self.args[0], indentation)


class IndentationPlanError(TaxelError, ValueError):
    """A design from which no plan of indentations can be sampled."""

    def __init__(self, field: str, expected: str, found: str) -> None:
        super().__init__(field, expected, found)

    def __str__(self) -> str:
        field, expected, found = self.args
        return f"indentation plan: {field}: expected {expected}, found {found}; correct the value"
