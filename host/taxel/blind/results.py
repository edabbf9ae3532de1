"""Result of one world: its truth, the verdicts of its diagnoses, and their comparison."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from taxel.blind.hidden import UNKNOWN, FaultLocation
from taxel.blind.loaded_locations import find_observable_taxels, loaded_locations
from taxel.blind.run_folder import get_reference_path, get_world_folder
from taxel.blind.scoring_rules import MIN_CLEAR_RATIO, model_key
from taxel.blind.world import World
from taxel.gap.effects.sticking import DERIVED_PARAMETERS, Sticking

MIN_TRUE_VALUE: Final = 1e-6
"""Parameters with a smaller true value have no meaningful relative error."""

MIN_SHARE_OF_MAX: Final = 0.3
"""Parameters of a board are compared if the true value is at least this share of the largest true value of all
boards."""


@dataclass(frozen=True)
class ReportedVerdict:
    """The verdict of a diagnosis, as its report states it.

    status, effects: see the report format. confounded_with_first: effects that the data cannot distinguish from the
    first effect. confounded_with: the same for each effect of the verdict.
    """

    status: str
    effects: tuple[str, ...]
    confounded_with_first: tuple[str, ...] = ()
    confounded_with: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def is_first(self, names: Collection[str]) -> bool:
        """Whether one of the effects `names` is first in the verdict, or confounded with the first effect."""
        return bool(self.effects) and not set(names).isdisjoint((self.effects[0], *self.confounded_with_first))

    @property
    def has_unknown(self) -> bool:
        """Whether the verdict contains an unknown cause, alone or in addition to effects."""
        return UNKNOWN in self.effects

    def count_named(self, names: Collection[str]) -> int:
        """Count the true causes `names` that the verdict contains.

        A true cause is also counted if a wrong effect of the verdict is confounded with it (the data cannot distinguish
        them); each wrong effect can replace one true cause.
        """
        missing = set(names) - set(self.effects)
        for effect in set(self.effects) - set(names):
            missing -= set(sorted(missing & set(self.confounded_with.get(effect, ())))[:1])
        return len(set(names)) - len(missing)

    @property
    def is_confident(self) -> bool:
        """Whether the verdict contains effects and excludes an unknown cause."""
        return bool(self.effects) and not self.has_unknown


@dataclass(frozen=True)
class ParameterComparison:
    """Estimate and true value of one parameter of a hidden cause.

    low, high: bounds of the 95 % interval. is_reference: the truth is a fit to noise-free indentations.
    """

    effect: str
    emulator_effect: str
    name: str
    unit: str
    estimate: float
    truth: float
    low: float | None
    high: float | None
    is_reference: bool

    @property
    def relative_error(self) -> float:
        """Relative error of the estimate: its absolute difference from the true value, divided by the true value."""
        return abs(self.estimate - self.truth) / max(abs(self.truth), 1e-9)


@dataclass(frozen=True)
class WorldResult:
    """Result of one world.

    Attributes:
        world: the world with its hidden causes.
        verdict: verdict of the diagnosis.
        gap, floor: gap and floor of the world, counts.
        runtime_s: duration of the diagnosis.
        shrink: predicted and measured shrink; None without a named effect.
        baseline_verdicts: names given by the simple reference diagnosers.
        parameters: comparisons of the named effect's parameters.
        is_location_found: whether the location of the fault is reported; None if no location is expected.
        unobservable_causes: those of several causes that no indentation could show, such as a broken line that is
            never loaded.
        verdict_withheld: verdict with the hidden effect removed from the catalogue; None if not diagnosed.
        verdict_shuffled: verdict with exchanged simulations; None if not diagnosed.
        verdict_decoy: verdict with an effect that is not hidden removed from the catalogue; None if not diagnosed.
        verdicts_by_seed: verdicts with other analysis seeds.
        error: reason for a missing report.
        isolation: mechanisms that isolated the diagnosing process.
        diagnosis_version: fingerprint of the diagnosis.
    """

    world: World
    verdict: ReportedVerdict
    gap: float = 0.0
    floor: float = 1.0
    runtime_s: float = 0.0
    shrink: tuple[float, float] | None = None
    baseline_verdicts: Mapping[str, str] = field(default_factory=dict)
    parameters: tuple[ParameterComparison, ...] = ()
    is_location_found: bool | None = None
    unobservable_causes: tuple[str, ...] = ()
    verdict_withheld: ReportedVerdict | None = None
    verdict_shuffled: ReportedVerdict | None = None
    verdict_decoy: ReportedVerdict | None = None
    verdicts_by_seed: tuple[ReportedVerdict, ...] = ()
    error: str = ""
    isolation: str = ""
    diagnosis_version: str = ""

    @property
    def ratio(self) -> float:
        """Gap divided by the floor, both in counts."""
        return self.gap / max(self.floor, 1e-9)

    @property
    def is_clear(self) -> bool:
        """Whether the gap is so large that the cause must be named.

        A world without a report counts as clear and wrong.
        """
        return bool(self.error) or self.ratio >= MIN_CLEAR_RATIO

    @property
    def is_first_correct(self) -> bool:
        """Whether the effect that the verdict names first is a hidden cause, or is confounded with a hidden cause."""
        return self.verdict.is_first(self.world.hidden.names)


def read_results(out: Path, worlds: list[World]) -> list[WorldResult]:
    """Read the results of all worlds of a blind check that are finished and have a report. out: folder of the check."""
    results = []
    for world in worlds:
        folder = get_world_folder(out, world)
        if not (folder / "done").exists() or not (folder / "report.json").exists():
            continue
        reference = get_reference_path(out, world)
        results.append(_make_result(world, folder, json.loads(reference.read_text()) if reference.exists() else {}))
    return results


def _make_result(world: World, folder: Path, reference: dict[str, dict[str, float]]) -> WorldResult:
    """Make the result of a world from the reports in its folder. reference: reference parameters by model key."""
    report = json.loads((folder / "report.json").read_text())
    result = WorldResult(
        world,
        _parse_verdict(report),
        is_location_found=is_location_found(world, report.get("effects", []), folder),
        unobservable_causes=_unobservable_causes(world, folder),
        verdict_withheld=_read_verdict(folder / "without.json"),
        verdict_shuffled=_read_verdict(folder / "shuffled.json"),
        verdict_decoy=_read_verdict(folder / "decoy.json"),
        verdicts_by_seed=tuple(
            _parse_verdict(json.loads(path.read_text())) for path in sorted(folder.glob("seed*.json"))
        ),
        error=str(report.get("error", "")),
        diagnosis_version=str(report.get("diagnosis", "")),
    )
    if result.error:
        return result
    after = report["after"]
    has_prediction = result.verdict.effects and result.verdict.status != UNKNOWN
    return replace(
        result,
        gap=float(report["gap"]["value"]),
        floor=float(report["gap"]["floor"]),
        runtime_s=float(report["runtime_s"]),
        shrink=(float(after["predicted_shrink"]), float(after["shrink"])) if has_prediction else None,
        baseline_verdicts=report["simpler"],
        parameters=_compare_parameters(world, report["effects"], reference),
        isolation=report["blindfold"],
    )


def _parse_verdict(report: dict[str, Any]) -> ReportedVerdict:
    """Extract the verdict from the JSON of a report; status "error" for a world without a diagnosis."""
    if "error" in report:
        return ReportedVerdict("error", ())
    verdict = report["verdict"]
    effects = tuple(verdict["effects"])
    confounded = {name: tuple(names) for name, names in verdict["confounded_with"].items()}
    return ReportedVerdict(verdict["status"], effects, confounded.get(effects[0], ()) if effects else (), confounded)


def _read_verdict(path: Path) -> ReportedVerdict | None:
    """Read the verdict of a report file; None if the file does not exist."""
    return _parse_verdict(json.loads(path.read_text())) if path.exists() else None


def _compare_parameters(
    world: World, effects: Sequence[dict[str, Any]], reference: dict[str, dict[str, float]]
) -> tuple[ParameterComparison, ...]:
    """Compare the estimated with the true parameters, for a world with a single cause that the verdict names.

    effects: entries of the report. reference: reference parameters by model key. The true value is the hidden value if
    the definition of the effect fixes it, otherwise the reference parameter.
    """
    if world.hidden.kind != "single":
        return ()
    (cause,) = world.hidden.causes
    rows = []
    for entry in effects:
        if entry["name"] != cause.name or not entry["in_verdict"]:
            continue
        # If a definition fixes some parameters of a cause, only these are compared.
        is_reference = not cause.parameters
        truth = reference.get(model_key(entry), {}) if is_reference else world.hidden.true_parameters(cause)
        for name, parameter in entry["parameters"].items():
            true_value = truth.get(name, 0.0)
            if isinstance(parameter["value"], list):
                continue
            if abs(true_value) < max(MIN_TRUE_VALUE, MIN_SHARE_OF_MAX * _max_value(truth, name)):
                continue
            if model_key(entry).startswith(Sticking.variant) and name in DERIVED_PARAMETERS:
                continue  # derived from the other parameters and from the duration of the record
            if cause.name == "pose_error" and name not in ("translation_mm", "rotation_deg"):
                continue  # the axis of rotation of an object is not identifiable from indentations along a face
            low, high = parameter["ci95"] or (None, None)
            rows.append(
                ParameterComparison(
                    cause.name,
                    cause.emulator_effect,
                    name,
                    parameter["unit"],
                    parameter["value"],
                    true_value,
                    low,
                    high,
                    is_reference,
                )
            )
    return tuple(rows)


def _max_value(truth: Mapping[str, float], name: str) -> float:
    """Return the largest absolute true value of a parameter over all boards. name: such as "scale@65" for board 65."""
    values = [abs(value) for key, value in truth.items() if key.partition("@")[0] == name.partition("@")[0]]
    return max(values, default=0.0)


def is_location_found(world: World, effects: Sequence[dict[str, Any]], folder: Path) -> bool | None:
    """Whether the report names the failed board or open line; None if no fault location is expected or loaded.

    effects: entries of the report. folder: of the world. If only one taxel of a line is observable, this taxel is
    accepted as the location, because a dead taxel and an open line are then indistinguishable.
    """
    if world.hidden.kind != "single" or world.hidden.causes[0].emulator_effect not in ("silent from", "line open"):
        return None
    (cause,) = world.hidden.causes
    locations = loaded_locations(cause.locations, folder / "sim.h5")
    if not locations:
        return None
    no_locations: dict[str, Any] = {"sensors": [], "lines": [], "taxels": []}
    reported = (entry["where"] for entry in effects if entry["name"] == "dropout" and entry["in_verdict"])
    where = next(reported, no_locations)  # an effect that was tried but is not in the verdict does not count
    lines = [tuple(line) for line in where["lines"]]

    def is_reported(location: FaultLocation) -> bool:
        """Whether the report names the location: a board, a line, or the only observable taxel of the line."""
        if not location.axis:
            return location.address in where["sensors"]
        if (location.address, location.axis, location.index) in lines:
            return True
        observable = find_observable_taxels(location, folder / "sim.h5")
        return len(observable) == 1 and observable[0] in where["taxels"]

    return all(is_reported(location) for location in locations)


def _unobservable_causes(world: World, folder: Path) -> tuple[str, ...]:
    """List the causes of a world with several causes whose lines or taxels are never loaded in the simulation."""
    if world.hidden.kind != "several":
        return ()
    local = [
        cause for cause in world.hidden.causes if cause.locations and all(location.axis for location in cause.locations)
    ]
    return tuple(cause.name for cause in local if not loaded_locations(cause.locations, folder / "sim.h5"))
