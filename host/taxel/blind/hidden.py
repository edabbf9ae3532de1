"""The causes that a world hides, and the correct verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

UNKNOWN = "unknown"


@dataclass(frozen=True)
class FaultLocation:
    """Location of a fault: a board (axis ""), a line of a board (axis "tx" or "rx"), or a taxel (axis "taxel").

    index: number of the line on the board, or of the taxel in the order of the hand.
    """

    address: int
    axis: str = ""
    index: int = -1


@dataclass(frozen=True)
class Cause:
    """One deviation of the emulated skin from the ideal sensor.

    name: effect of the catalogue, or "unknown" for a cause outside the catalogue. emulator_effect: effect and variant
    in the emulator, such as "spread film". lines: effect lines of the world file. locations: of a local cause.
    parameters: true values in the terms of a report, such as {"spread_mm": 2.0, "seconds@81": 0.1}; parameters that no
    definition fixes are absent.
    """

    name: str
    emulator_effect: str
    lines: tuple[str, ...]
    locations: tuple[FaultLocation, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return the hidden cause as the JSON values that are sealed."""
        return {
            "name": self.name,
            "form": self.emulator_effect,
            "lines": list(self.lines),
            "places": [asdict(location) for location in self.locations],
            "parameters": dict(self.parameters),
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Cause:
        """Create a hidden cause from the JSON values of `to_json`."""
        locations = tuple(FaultLocation(**location) for location in data["places"])
        return cls(data["name"], data["form"], tuple(data["lines"]), locations, dict(data["parameters"]))


@dataclass(frozen=True)
class HiddenCauses:
    """All hidden causes of a world. kind: "none", "single", "several", "outside" or "lookalike".

    nuisances: effect lines of small, unavoidable deviations. Every world has the same ones with other values, because a
    missing nuisance would reveal the cause that replaces it.
    """

    kind: str
    causes: tuple[Cause, ...]
    nuisances: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects in the correct verdict, in no particular order."""
        return tuple(cause.name for cause in self.causes)

    @property
    def lines(self) -> tuple[str, ...]:
        """Effect lines for the emulator's world file: those of the hidden causes, then those of the nuisances."""
        return (*(line for cause in self.causes for line in cause.lines), *self.nuisances)

    def true_parameters(self, cause: Cause) -> dict[str, float]:
        """Return the true parameters of a hidden cause, as a report can estimate them.

        A nuisance (a small deviation of every skin) of the same emulator effect adds its variance to that of the cause.
        """
        parameters = dict(cause.parameters)
        for line in self.nuisances:
            emulator_effect, _, log_std = line.partition(" log_std=")
            if emulator_effect == cause.emulator_effect and "log_std" in parameters:
                parameters["log_std"] = math.hypot(parameters["log_std"], float(log_std))
        return parameters

    def to_json(self) -> dict[str, Any]:
        """Return the hidden causes of a world, with the nuisances, as the JSON values that are sealed."""
        causes = [cause.to_json() for cause in self.causes]
        return {"kind": self.kind, "causes": causes, "nuisances": list(self.nuisances)}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> HiddenCauses:
        """Create the hidden causes of a world from the JSON values of `to_json`."""
        causes = tuple(Cause.from_json(cause) for cause in data["causes"])
        return cls(data["kind"], causes, tuple(data["nuisances"]))
