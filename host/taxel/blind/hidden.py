"""What a world hides, and what a right answer is."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

UNKNOWN = "unknown"


@dataclass(frozen=True)
class Place:
    """Where something does not answer: a board (axis ""), a line of it (axis "tx" or "rx"), or a taxel ("taxel").

    index: of the line; of a taxel in the hand's order.
    """

    address: int
    axis: str = ""
    index: int = -1


@dataclass(frozen=True)
class Cause:
    """One departure from the ideal sensor.

    name: as the report page has it, or "unknown" for one outside the catalogue. form: the emulator's words for it.
    lines: of the world file. places: where, if it is local. parameters: truth in the report's terms, such as
    {"spread_mm": 2.0, "seconds@81": 0.1}; those that no definition fixes are absent.
    """

    name: str
    form: str
    lines: tuple[str, ...]
    places: tuple[Place, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Hidden:
    """All that a world hides. kind: "none", "single", "several", "outside", "lookalike".

    nuisances: lines of the world file, small, and the same in every world but for their numbers: that one is missing
    would tell what hides it.
    """

    kind: str
    causes: tuple[Cause, ...]
    nuisances: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Right answer, in no order."""
        return tuple(cause.name for cause in self.causes)

    @property
    def lines(self) -> tuple[str, ...]:
        """For the emulator."""
        return (*(line for cause in self.causes for line in cause.lines), *self.nuisances)

    def truth(self, cause: Cause) -> dict[str, float]:
        """A cause's parameters as a report can find them: a spread adds in quadrature to a nuisance of its form."""
        found = dict(cause.parameters)
        for line in self.nuisances:
            form, _, spread = line.partition(" log_std=")
            if form == cause.form and "log_std" in found:
                found["log_std"] = math.hypot(found["log_std"], float(spread))
        return found

    def to_json(self) -> dict[str, Any]:
        """For the seal."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Hidden:
        """What `to_json` gave."""
        causes = tuple(
            Cause(
                one["name"],
                one["form"],
                tuple(one["lines"]),
                tuple(Place(**place) for place in one["places"]),
                dict(one["parameters"]),
            )
            for one in data["causes"]
        )
        return cls(data["kind"], causes, tuple(data["nuisances"]))
