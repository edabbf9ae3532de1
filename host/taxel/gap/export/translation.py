"""Effects of a report as numeric steps that need neither the report nor this package."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import BOARD
from taxel.gap.effects.pillar_propagation import FALLEN
from taxel.gap.effects.plate import HALF_SHARE
from taxel.gap.effects.sheet_kernel import sheet_kernel, taxel_kernel
from taxel.gap.export.common import ExportSource
from taxel.gap.export.mixing import mix_lines, mix_shorts
from taxel.gap.report.reading import ReportedEffect
from taxel.types import FloatArray

Step = dict[str, Any]

EVEN_LOAD: Final = "the load is even on each taxel: the file has no meshes that distribute it"
SINKING: Final = "objects sink deeper into a softer layer: the contact itself must be simulated again"
POSE: Final = "a displaced object or bracket changes the contact itself: change the pose in the simulator"
CUSTOM: Final = "an effect of another package: its code is not part of the file"
NEGATIVE_DELAY: Final = "a board that precedes the simulator: apply() uses a delay of 0; apply_recording() is exact"


@dataclass(frozen=True, eq=False)
class Translation:
    """Effects as numbers for each taxel or board.

    steps: in the order in which they act; `kind` is a key of `skin_steps.STEPS`, `effect` the name in the report.
    delay_s: of each taxel, f64[n]. noise: standard deviations f64[4, n], see `NOISE_PARTS`. lost: share of the frames
    of each board, f64[boards]. stuck: taxels with a constant count. expressed: names of the translated effects.
    approximated, not_expressed: reason by name.
    """

    steps: tuple[Step, ...] = ()
    delay_s: FloatArray = field(default_factory=lambda: np.zeros(0))
    noise: FloatArray = field(default_factory=lambda: np.zeros((4, 0)))
    lost: FloatArray = field(default_factory=lambda: np.zeros(0))
    stuck: tuple[int, ...] = ()
    expressed: tuple[str, ...] = ()
    approximated: Mapping[str, str] = field(default_factory=dict)
    not_expressed: Mapping[str, str] = field(default_factory=dict)

    def changed(self, **changes: Any) -> Translation:
        """The same translation with other values of some fields."""
        return replace(self, **changes)

    def restricted(
        self, steps: Sequence[Step], approximated: Mapping[str, str], refused: Mapping[str, str]
    ) -> Translation:
        """The translation with the steps that a format has.

        approximated, refused: reasons, by effect. A refused effect is neither approximated nor expressed.
        """
        return self.changed(
            steps=tuple(steps),
            approximated={name: reason for name, reason in approximated.items() if name not in refused},
            not_expressed=dict(refused),
            expressed=tuple(name for name in self.expressed if name not in refused),
        )


class UntranslatableError(Exception):
    """The reason for which an effect has no translation."""


def translate(source: ExportSource) -> Translation:
    """Translate the effects of a report. Effects without translation are listed with the reason."""
    steps: list[Step] = []
    approximated: dict[str, str] = {}
    refused: dict[str, str] = {}
    result = Translation(delay_s=np.zeros(source.n), noise=np.zeros((4, source.n)), lost=np.zeros(len(source.boards)))
    for one in source.report.effects:
        form = str(one.content["form"])
        try:
            if one.name == "noise":
                result = result.changed(noise=np.stack([source.values_of(one, name) for name in one.parameters]))
            elif one.name == "latency" and form == "delay":
                delay_s = source.values_of(one, "seconds")
                delay_s = delay_s + one.shift_s if delay_s.any() else delay_s
                result = result.changed(delay_s=delay_s)
                if (delay_s < 0.0).any():
                    approximated[one.name] = NEGATIVE_DELAY
            else:
                steps += [{"effect": one.name, **step} for step in _translated(source, one, form)]
        except UntranslatableError as reason:
            refused[one.name] = str(reason)
            continue
        if one.name == "dropout":
            lost = np.array([one.missing.get(address, 0.0) for address in source.boards])
            result = result.changed(lost=lost, stuck=one.stuck)
        if one.name == "contact_propagation" and form in ("kept", "added", "pillars"):
            approximated[one.name] = EVEN_LOAD
    names = tuple(one.name for one in source.report.effects if one.name not in refused)
    return result.changed(steps=tuple(steps), expressed=names, approximated=approximated, not_expressed=refused)


def _translated(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    make = _MAKERS.get(one.name)
    if make is None:
        raise UntranslatableError(CUSTOM)
    return make(source, one, form)


def _require_model(source: ExportSource) -> None:
    if source.model is None:
        reason = source.missing or "the simulated dataset has no sensor model"
        raise UntranslatableError(f"the sensor model of the simulation is needed: {reason}")


def _full_scale(source: ExportSource) -> float:
    _require_model(source)
    assert source.model is not None
    return float(source.model.full_scale_drop_counts)


def _propagation(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    if not source.layouts:
        raise UntranslatableError(f"the positions of the taxels are needed: {source.missing}")
    if not form.startswith("signal"):
        _require_model(source)
    spread, strength = source.values_of(one, "spread_mm"), source.values_of(one, "strength")
    boards = []
    for layout in source.layouts:
        first = int(layout.taxels[0])
        spread_m, share = 1e-3 * float(spread[first]), float(strength[first])
        if form == "pillars":
            pieces = layout.pieces.tolist()
            boards.append({"pieces": pieces, "reach_m": spread_m / float(FALLEN), "strength": share})
        else:
            own = 1.0 if "added" in form else 1.0 - share
            kernel = taxel_kernel(sheet_kernel(layout, spread_m), None)
            boards.append({"matrix": own * np.eye(len(layout.taxels)) + share * kernel})
        boards[-1]["taxels"] = layout.taxels
    if form == "pillars":
        assert source.model is not None
        half_n = 0.5 * float(np.mean(source.model.half_force_n))
        return [{"kind": "pillars", "boards": boards, "half_depth_n": half_n}]
    return [{"kind": "mix_signal" if form.startswith("signal") else "mix_force", "boards": boards}]


def _stiffness(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    if form == "sinking":
        raise UntranslatableError(SINKING)
    _require_model(source)
    return [{"kind": "half_force", "factor": source.values_of(one, "half_force_scale")}]


def _hysteresis(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    step: Step = {name: source.values_of(one, name) for name in one.parameters}
    kinds = {"drop": "late_signal", "gap": "late_gap", "force": "late_force", "more": "late_more"}
    if form == "drop":
        return [{"kind": kinds[form], **step}]
    if form in ("gap", "sticks"):
        step["half_counts"] = HALF_SHARE * _full_scale(source)
        return [{"kind": kinds.get(form, "sticks"), **step}]
    _require_model(source)
    if form == "depth":
        law = source.law
        if law is None:
            raise UntranslatableError("the simulation has no contact forces, from which the law of the layer follows")
        depth_m = np.append(law.depth_m, law.depth_m[-1] + 1.0)
        slope = float((law.force_n[-1] - law.force_n[-2]) / (law.depth_m[-1] - law.depth_m[-2]))
        return [
            {
                "kind": "late_depth",
                **step,
                "depth_m": depth_m,
                "force_n": np.append(law.force_n, law.force_n[-1] + slope),
            }
        ]
    return [{"kind": kinds[form], **step}]


def _proximity(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    values = {"range_m": 1e-3 * source.values_of(one, "range_mm"), "counts": source.values_of(one, "counts")}
    return [{"kind": "proximity", **values, "is_exponential": float(form == "exponential")}]


def _gain(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    return [{"kind": "scale", "factor": np.exp(source.values_of(one, "log_gain"))}]


def _nonlinearity(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    return [{"kind": "power", "exponent": source.values_of(one, "exponent"), "scale_counts": _full_scale(source)}]


def _saturation(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    return [{"kind": form, "counts": source.values_of(one, "counts")}]


def _crosstalk(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    names = [name for name in one.parameters if name != "own_ratio"]
    boards = []
    for _, taxels in source.taxels_of_boards():
        first = int(taxels[0])
        fractions = np.array([source.values_of(one, name)[first] for name in names])
        own = float(source.values_of(one, "own_ratio")[first]) if "own_ratio" in one.parameters else 0.0
        tx, rx = source.report.tx[taxels], source.report.rx[taxels]
        boards.append({"taxels": taxels, "matrix": mix_lines(tx, rx, fractions, own)})
    return [{"kind": "mix_signal", "boards": boards}]


def _drift(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    block = np.maximum(source.blocks_of(one), 0) if one.effect.scope == BOARD else np.zeros(source.n, int)
    slope, deviation = source.values_of(one, "slope"), source.values_of(one, "scatter")
    return [{"kind": "drift", "slope": slope, "deviation": deviation, "block": block, "until_s": one.until_s}]


def _dropout(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    remaining = source.values_of(one, one.parameters[0])
    shorts = one.effect.dropped.shorts if isinstance(one.effect, Dropout) else ()
    if not shorts:
        return [{"kind": "scale", "factor": remaining}] if (remaining != 1.0).any() else []
    boards = []
    for address, taxels in source.taxels_of_boards():
        own = [(short.axis, short.index, short.share) for short in shorts if short.address == address]
        matrix = mix_shorts(source.report.tx[taxels], source.report.rx[taxels], remaining[taxels], own)
        boards.append({"taxels": taxels, "matrix": matrix})
    return [{"kind": "mix_signal", "boards": boards}]


def _lag(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    return [{"kind": "lag", "seconds": source.values_of(one, "seconds")}]


def _pose_error(source: ExportSource, one: ReportedEffect, form: str) -> list[Step]:
    raise UntranslatableError(POSE)


_MAKERS: Final[Mapping[str, Callable[[ExportSource, ReportedEffect, str], list[Step]]]] = MappingProxyType(
    {
        "contact_propagation": _propagation,
        "stiffness": _stiffness,
        "hysteresis": _hysteresis,
        "proximity": _proximity,
        "gain_mismatch": _gain,
        "nonlinearity": _nonlinearity,
        "saturation": _saturation,
        "electrode_crosstalk": _crosstalk,
        "baseline_drift": _drift,
        "dropout": _dropout,
        "latency": _lag,
        "pose_error": _pose_error,
    }
)
