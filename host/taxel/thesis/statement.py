"""Statements of the thesis, and the evidence on which they are tested."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from taxel.thesis.object_result import ObjectResult
from taxel.thesis.shape_counts import ShapeCount


@dataclass(frozen=True)
class Evidence:
    """What the findings are tested on. results: of the objects, in the order of the thesis. shapes: identified ones."""

    results: tuple[ObjectResult, ...]
    shapes: tuple[ShapeCount, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Printed names of the objects."""
        return tuple(result.printed_name for result in self.results)


Outcome = tuple[float, bool]
"""A number, and whether the finding holds for the object."""

Test = Callable[[Evidence], Mapping[str, Outcome] | None]
"""Test of a finding: outcome by printed name of the object; None if the evidence lacks the necessary results."""


@dataclass(frozen=True)
class Statement:
    """A statement of the thesis. source: section, paragraph and sentence. criterion: the test in words, with `unit`."""

    key: str
    text: str
    source: str
    criterion: str
    unit: str
    test: Test
