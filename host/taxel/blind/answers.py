"""One world's answer beside its truth: a row of the score."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from taxel.blind.asked import CLEAR, form_of
from taxel.blind.drawing import World
from taxel.blind.hidden import UNKNOWN, Place
from taxel.blind.loaded import loaded, taxels_that_show
from taxel.blind.run import WORLDS
from taxel.gap.effects.sticking import WORKED_OUT, Sticking

LEAST_TRUE: Final = 1e-6
"""A parameter below it is nothing that a relative error could be told of."""

SMALL: Final = 0.3
"""Share of the greatest board's value below which a relative error of another board's says nothing."""


@dataclass(frozen=True)
class Named:
    """What a report says. status, effects: of its verdict. rivals: what it calls confounded with the first; alike: with
    each of the effects.
    """

    status: str
    effects: tuple[str, ...]
    rivals: tuple[str, ...] = ()
    alike: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def is_first(self, names: Collection[str]) -> bool:
        """Whether one of `names` is named first, or called confounded with what is."""
        return bool(self.effects) and not set(names).isdisjoint((self.effects[0], *self.rivals))

    @property
    def says_unknown(self) -> bool:
        """Alone, or beside a name."""
        return UNKNOWN in self.effects

    def hits(self, names: Collection[str]) -> int:
        """How many of the causes `names` are named, or stand in the class of another that is."""
        left = set(names) - set(self.effects)
        for name in set(self.effects) - set(names):
            left -= set(sorted(left & set(self.alike.get(name, ())))[:1])
        return len(set(names)) - len(left)

    @property
    def misnames(self) -> bool:
        """Names causes and is sure that nothing else is there."""
        return bool(self.effects) and not self.says_unknown


@dataclass(frozen=True)
class Compared:
    """One parameter: found and true, interval, unit. reference: the truth is a fit to noise-free presses."""

    effect: str
    form: str
    name: str
    unit: str
    found: float
    true: float
    low: float | None
    high: float | None
    reference: bool

    @property
    def error(self) -> float:
        """Relative."""
        return abs(self.found - self.true) / max(abs(self.true), 1e-9)


@dataclass(frozen=True)
class Answer:
    """One world, scored. gap, floor: counts. shrink: (predicted, measured) or None.

    found_places: None where nothing is to be found by place. idle: causes of a pair or triple that no press could show,
    as a line that breaks where nothing bears. without, shuffled, decoy: what is said with the effect deleted, with the
    simulations exchanged, and with another effect deleted; None where that was not asked. seeds: with other analysis
    seeds. error: why there is no report. blindfold: what hid the truth. diagnosis: its version.
    """

    world: World
    named: Named
    gap: float = 0.0
    floor: float = 1.0
    runtime_s: float = 0.0
    shrink: tuple[float, float] | None = None
    simpler: Mapping[str, str] = field(default_factory=dict)
    parameters: tuple[Compared, ...] = ()
    found_places: bool | None = None
    idle: tuple[str, ...] = ()
    without: Named | None = None
    shuffled: Named | None = None
    decoy: Named | None = None
    seeds: tuple[Named, ...] = ()
    error: str = ""
    blindfold: str = ""
    diagnosis: str = ""

    @property
    def ratio(self) -> float:
        """Gap over floor."""
        return self.gap / max(self.floor, 1e-9)

    @property
    def clear(self) -> bool:
        """Whether an answer is asked for; no report is a wrong one, whatever the gap."""
        return bool(self.error) or self.ratio >= CLEAR

    @property
    def first_right(self) -> bool:
        """The strongest cause named first, or one that the report calls indistinguishable from it."""
        return self.named.is_first(self.world.hidden.names)


def answers(out: Path, worlds: list[World]) -> list[Answer]:
    """All that have a result."""
    found = []
    for world in worlds:
        folder = out / WORLDS / f"{world.number:04d}"
        if not (folder / "done").exists() or not (folder / "report.json").exists():
            continue
        reference = out / "sealed" / f"reference{world.number:04d}.json"
        found.append(_answer(world, folder, json.loads(reference.read_text()) if reference.exists() else {}))
    return found


def _answer(world: World, folder: Path, reference: dict[str, dict[str, float]]) -> Answer:
    report = json.loads((folder / "report.json").read_text())
    answer = Answer(
        world,
        _named(report),
        found_places=_places_found(world, report.get("effects", []), folder),
        idle=_idle(world, folder),
        without=_named_in(folder / "without.json"),
        shuffled=_named_in(folder / "shuffled.json"),
        decoy=_named_in(folder / "decoy.json"),
        seeds=tuple(_named(json.loads(path.read_text())) for path in sorted(folder.glob("seed*.json"))),
        error=str(report.get("error", "")),
        diagnosis=str(report.get("diagnosis", "")),
    )
    if answer.error:
        return answer
    after = report["after"]
    promises = answer.named.effects and answer.named.status != UNKNOWN
    return replace(
        answer,
        gap=float(report["gap"]["value"]),
        floor=float(report["gap"]["floor"]),
        runtime_s=float(report["runtime_s"]),
        shrink=(float(after["predicted_shrink"]), float(after["shrink"])) if promises else None,
        simpler=report["simpler"],
        parameters=_compared(world, report["effects"], reference),
        blindfold=report["blindfold"],
    )


def _named(report: dict[str, Any]) -> Named:
    if "error" in report:
        return Named("error", ())
    verdict = report["verdict"]
    effects = tuple(verdict["effects"])
    alike = {name: tuple(others) for name, others in verdict["confounded_with"].items()}
    return Named(verdict["status"], effects, alike.get(effects[0], ()) if effects else (), alike)


def _named_in(path: Path) -> Named | None:
    return _named(json.loads(path.read_text())) if path.exists() else None


def _compared(
    world: World, effects: Sequence[dict[str, Any]], reference: dict[str, dict[str, float]]
) -> tuple[Compared, ...]:
    """Parameters of single worlds whose effect was named: those that a definition fixes, else the reference's."""
    if world.hidden.kind != "single":
        return ()
    (cause,) = world.hidden.causes
    rows = []
    for entry in effects:
        if entry["name"] != cause.name or not entry["in_verdict"]:
            continue
        # What a definition fixes is asked for alone; the rest of such a cause has no truth.
        by_fit = not cause.parameters
        still = reference.get(form_of(entry), {})
        truth = still if by_fit else world.hidden.truth(cause)
        for name, one in entry["parameters"].items():
            true = truth.get(name, 0.0)
            if isinstance(one["value"], list) or abs(true) < max(LEAST_TRUE, SMALL * _greatest(truth, name)):
                continue
            if form_of(entry).startswith(Sticking.variant) and name in WORKED_OUT:
                continue  # of the others, and of how long the record is
            if cause.name == "pose_error" and name not in ("translation_mm", "rotation_deg"):
                continue  # where about its origin an object has turned, a press along its face does not tell
            low, high = one["ci95"] or (None, None)
            rows.append(Compared(cause.name, cause.form, name, one["unit"], one["value"], true, low, high, by_fit))
    return tuple(rows)


def _greatest(truth: Mapping[str, float], name: str) -> float:
    """Size of the largest of a parameter's values: boards that have next to nothing of it are not asked."""
    own = [abs(value) for key, value in truth.items() if key.partition("@")[0] == name.partition("@")[0]]
    return max(own, default=0.0)


def _places_found(world: World, effects: Sequence[dict[str, Any]], folder: Path) -> bool | None:
    """Whether the silent board or open line is named by its place; None if none of it was loaded. Of a line that one
    taxel alone could show, that taxel is the place: it might as well be dead.
    """
    if world.hidden.kind != "single" or world.hidden.causes[0].form not in ("silent from", "line open"):
        return None
    (cause,) = world.hidden.causes
    places = loaded(cause.places, folder / "sim.h5")
    if not places:
        return None
    nowhere: dict[str, Any] = {"sensors": [], "lines": [], "taxels": []}
    named = (one["where"] for one in effects if one["name"] == "dropout" and one["in_verdict"])
    acts = next(named, nowhere)  # what was tried and not believed is not found
    lines = [tuple(line) for line in acts["lines"]]

    def is_found(place: Place) -> bool:
        if not place.axis:
            return place.address in acts["sensors"]
        if (place.address, place.axis, place.index) in lines:
            return True
        shown = taxels_that_show(place, folder / "sim.h5")
        return len(shown) == 1 and shown[0] in acts["taxels"]

    return all(is_found(place) for place in places)


def _idle(world: World, folder: Path) -> tuple[str, ...]:
    """Causes of several whose lines or taxels all bear nothing."""
    if world.hidden.kind != "several":
        return ()
    local = [cause for cause in world.hidden.causes if cause.places and all(place.axis for place in cause.places)]
    return tuple(cause.name for cause in local if not loaded(cause.places, folder / "sim.h5"))
