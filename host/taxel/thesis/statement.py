"""Statements of the thesis, and the results on which they are tested."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from taxel.thesis.object_result import ObjectResult
from taxel.thesis.shape_counts import ShapeCount


@dataclass(frozen=True)
class Evidence:
    """Results on which the statements are tested.

    results: results of the objects, in the order of the thesis. shapes: numbers of identified shapes; may be empty.
    """

    results: tuple[ObjectResult, ...]
    shapes: tuple[ShapeCount, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Printed names of the objects."""
        return tuple(result.printed_name for result in self.results)


Outcome = tuple[float, bool]
"""Outcome of a statement's test for one object: the number that is shown, and whether the statement holds."""

Test = Callable[[Evidence], Mapping[str, Outcome] | None]
"""Test of a statement: outcome by printed name of the object; None if the evidence lacks the necessary results."""


@dataclass(frozen=True)
class Statement:
    """A qualitative statement of the thesis with its test.

    key: identifier. text: the statement. source: section, paragraph and sentence. criterion: the test in words. unit:
    unit of the number that the test returns, "1" without a unit.
    """

    key: str
    text: str
    source: str
    criterion: str
    unit: str
    test: Test
