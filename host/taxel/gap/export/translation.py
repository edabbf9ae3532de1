"""Effects of a report as numeric steps that need neither the report nor this package."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from taxel.gap.effects.baseline_drift import FROM_CLOSING
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import BOARD
from taxel.gap.effects.pillar_propagation import DECREASE_AT_SPREAD
from taxel.gap.effects.plate import HALF_CLOSED_SHARE
from taxel.gap.effects.sheet_kernel import compute_even_kernel
from taxel.gap.export.common import ExportSource
from taxel.gap.export.mixing import build_crosstalk_matrix, build_shorts_matrix
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

    steps: numeric operations in the order in which they act; `kind` (a key of `skin_steps.STEPS`) names the operation,
    `effect` the effect in the report. delay_s: delay of each taxel, f64[n] (n taxels), seconds. noise: standard
    deviations of the four components of the noise, f64[4, n], counts, see `NOISE_COMPONENTS`. lost: share of lost
    frames of each board, f64[boards]. stuck: indices of taxels with a constant count. expressed: names of translated
    effects. approximated, not_expressed: effects that are translated approximately, or not at all, with the reason, by
    name.
    """

    steps: tuple[Step, ...] = ()
    delay_s: FloatArray = field(default_factory=lambda: np.zeros(0))
    noise: FloatArray = field(default_factory=lambda: np.zeros((4, 0)))
    lost: FloatArray = field(default_factory=lambda: np.zeros(0))
    stuck: tuple[int, ...] = ()
    expressed: tuple[str, ...] = ()
    approximated: Mapping[str, str] = field(default_factory=dict)
    not_expressed: Mapping[str, str] = field(default_factory=dict)

    def with_fields(self, **changes: Any) -> Translation:
        """Return a copy with other values of some fields."""
        return replace(self, **changes)

    def restrict(
        self, steps: Sequence[Step], approximated: Mapping[str, str], refused: Mapping[str, str]
    ) -> Translation:
        """Return a copy with only the steps that a file format supports.

        approximated: reasons by effect. refused: reasons by name of an effect that the format does not support; such an
        effect keeps none of its steps, and is listed neither as approximated nor as expressed.
        """
        return self.with_fields(
            steps=tuple(step for step in steps if step["effect"] not in refused),
            approximated={name: reason for name, reason in approximated.items() if name not in refused},
            not_expressed=dict(refused),
            expressed=tuple(name for name in self.expressed if name not in refused),
        )


class UntranslatableError(Exception):
    """An effect has no translation; the message states why."""


def translate(source: ExportSource) -> Translation:
    """Translate the effects of a report into steps.

    An effect without translation is listed with the reason in `not_expressed`. Raises GapInputError for a simulated
    grasp without hold.
    """
    steps: list[Step] = []
    approximated: dict[str, str] = {}
    refused: dict[str, str] = {}
    result = Translation(delay_s=np.zeros(source.n), noise=np.zeros((4, source.n)), lost=np.zeros(len(source.boards)))
    for reported_effect in source.report.effects:
        form = str(reported_effect.content["form"])
        try:
            if reported_effect.name == "noise":
                result = result.with_fields(
                    noise=np.stack([source.expand_values(reported_effect, name) for name in reported_effect.parameters])
                )
            elif reported_effect.name == "latency" and form == "delay":
                delay_s = source.expand_values(reported_effect, "seconds")
                delay_s = delay_s + reported_effect.shift_s if delay_s.any() else delay_s
                result = result.with_fields(delay_s=delay_s)
                if (delay_s < 0.0).any():
                    approximated[reported_effect.name] = NEGATIVE_DELAY
            else:
                steps += [
                    {"effect": reported_effect.name, **step}
                    for step in _translate_effect(source, reported_effect, form)
                ]
        except UntranslatableError as reason:
            refused[reported_effect.name] = str(reason)
            continue
        if reported_effect.name == "dropout":
            lost = np.array([reported_effect.missing.get(address, 0.0) for address in source.boards])
            result = result.with_fields(lost=lost, stuck=reported_effect.stuck)
        if reported_effect.name == "contact_propagation" and form in ("kept", "added", "pillars"):
            approximated[reported_effect.name] = EVEN_LOAD
    names = tuple(
        reported_effect.name for reported_effect in source.report.effects if reported_effect.name not in refused
    )
    return result.with_fields(steps=tuple(steps), expressed=names, approximated=approximated, not_expressed=refused)


def _translate_effect(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    """Return the steps of an effect in a form. Raises UntranslatableError for an effect without translation."""
    translator = _TRANSLATORS.get(reported_effect.name)
    if translator is None:
        raise UntranslatableError(CUSTOM)
    return translator(source, reported_effect, form)


def _require_model(source: ExportSource) -> None:
    """Raise UntranslatableError without a sensor model."""
    if source.model is None:
        reason = source.missing or "the simulated dataset has no sensor model"
        raise UntranslatableError(f"the sensor model of the simulation is needed: {reason}")


def _get_full_scale(source: ExportSource) -> float:
    """Return the full scale of the sensor model, counts. Raises UntranslatableError without a sensor model."""
    _require_model(source)
    assert source.model is not None
    return float(source.model.full_scale_drop_counts)


def _translate_propagation(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    """Return the step of contact propagation: a mixing matrix for each board, or in the form "pillars" the pieces.

    Raises UntranslatableError without positions of the taxels, and for spreading forces without a sensor model.
    """
    if not source.layouts:
        raise UntranslatableError(f"the positions of the taxels are needed: {source.missing}")
    spreads_signal = form.startswith(("signal", "counts"))
    if not spreads_signal:
        _require_model(source)
    spread, strength, *shape = (source.expand_values(reported_effect, name) for name in reported_effect.parameters)
    boards = []
    for layout in source.layouts:
        first = int(layout.taxels[0])
        spread_m, share = 1e-3 * float(spread[first]), float(strength[first])
        if form == "pillars":
            pieces = layout.piece_centres.tolist()
            boards.append({"pieces": pieces, "reach_m": spread_m / float(DECREASE_AT_SPREAD), "strength": share})
        else:
            kept_share = 1.0 if "added" in form else 1.0 - share
            shapes = [float(values[first]) for values in shape]  # empty for an exponential kernel
            kernel = compute_even_kernel(layout, spread_m, *shapes)
            boards.append({"matrix": kept_share * np.eye(len(layout.taxels)) + share * kernel})
        boards[-1]["taxels"] = layout.taxels
    if form == "pillars":
        assert source.model is not None
        half_n = 0.5 * float(np.mean(source.model.half_force_n))  # as in `pillar_propagation._compute_unit_gain`
        return [{"kind": "pillars", "boards": boards, "half_depth_n": half_n}]
    return [{"kind": "mix_signal" if spreads_signal else "mix_force", "boards": boards}]


def _translate_stiffness(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    """Return the steps of a stiffness: the scale of the half force, and in the form "curved" the power of the force.

    Raises UntranslatableError for sinking objects, or without a sensor model.
    """
    if form == "sinking":
        raise UntranslatableError(SINKING)
    _require_model(source)
    scale, *exponent = (source.expand_values(reported_effect, name) for name in reported_effect.parameters)
    curve = [{"kind": "power_force", "exponent": values} for values in exponent]
    return [{"kind": "half_force", "factor": scale}, *curve]


def _translate_hysteresis(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    """Return the step of a hysteresis, which depends on the quantity (`form`) of which a share is late.

    Raises UntranslatableError if the form needs a sensor model or contact forces that the dataset lacks.
    """
    step: Step = {name: source.expand_values(reported_effect, name) for name in reported_effect.parameters}
    kinds = {"drop": "late_signal", "gap": "late_gap", "force": "late_force", "more": "late_more"}
    if form == "drop":
        return [{"kind": kinds[form], **step}]
    if form in ("gap", "sticks"):
        step["half_counts"] = HALF_CLOSED_SHARE * _get_full_scale(source)
        return [{"kind": kinds.get(form, "sticks"), **step}]
    _require_model(source)
    if form == "depth":
        law = source.law
        if law is None:
            raise UntranslatableError("the simulation has no contact forces, from which the law of the layer follows")
        # The last point continues the law by 1 m on its last tangent, for forces above the recorded ones.
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


def _translate_proximity(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    """Return the step of a proximity signal, with its range in metres."""
    range_mm, counts, *shape = (source.expand_values(reported_effect, name) for name in reported_effect.parameters)
    step = {"range_m": 1e-3 * range_mm, "counts": counts, "is_exponential": float(form != "linear")}
    return [{"kind": "proximity", **step, "shape": shape[0] if shape else 1.0}]


def _translate_gain(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    return [{"kind": "scale", "factor": np.exp(source.expand_values(reported_effect, "log_gain"))}]


def _translate_nonlinearity(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    """Return the step of another curve of the signal; raises UntranslatableError without a sensor model."""
    values = {name: source.expand_values(reported_effect, name) for name in reported_effect.parameters}
    return [{"kind": form or "power", **values, "scale_counts": _get_full_scale(source)}]


def _translate_saturation(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    values = {name: source.expand_values(reported_effect, name) for name in reported_effect.parameters}
    return [{"kind": form, **values}]


def _translate_crosstalk(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    """Return the step of crosstalk: a mixing matrix of the signals for each board."""
    names = [name for name in reported_effect.parameters if name != "own_ratio"]
    boards = []
    for _, taxels in source.iterate_boards():
        first = int(taxels[0])
        fractions = np.array([source.expand_values(reported_effect, name)[first] for name in names])
        own_ratio = (
            float(source.expand_values(reported_effect, "own_ratio")[first])
            if "own_ratio" in reported_effect.parameters
            else 0.0
        )
        tx, rx = source.report.tx[taxels], source.report.rx[taxels]
        boards.append({"taxels": taxels, "matrix": build_crosstalk_matrix(tx, rx, fractions, own_ratio)})
    return [{"kind": "mix_signal", "boards": boards}]


def _translate_drift(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    """Return the step of a drift.

    slope: drift from its beginning until `until_s` (seconds since the beginning of closing), counts. deviation:
    standard deviation of this drift between grasps (parameter `scatter` of the effect). block: taxels with the same
    number drift together. from_closing: 1 if the drift begins with the closing, 0 if it begins in the baseline frames.
    """
    block = (
        np.maximum(source.map_blocks(reported_effect), 0)
        if reported_effect.effect.scope == BOARD
        else np.zeros(source.n, int)
    )
    slope, deviation = source.expand_values(reported_effect, "slope"), source.expand_values(reported_effect, "scatter")
    return [
        {
            "kind": "drift",
            "slope": slope,
            "deviation": deviation,
            "block": block,
            "until_s": reported_effect.until_s,
            "from_closing": int(form == FROM_CLOSING),
        }
    ]


def _translate_dropout(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    """Return the step of dead taxels as factors, or of shorted lines as a mixing matrix for each board.

    The list is empty if only frames are missing, which `Translation.lost` contains.
    """
    remaining = source.expand_values(reported_effect, reported_effect.parameters[0])
    shorts = reported_effect.effect.defects.shorts if isinstance(reported_effect.effect, Dropout) else ()
    if not shorts:
        return [{"kind": "scale", "factor": remaining}] if (remaining != 1.0).any() else []
    boards = []
    for address, taxels in source.iterate_boards():
        board_shorts = [(short.axis, short.index, short.share) for short in shorts if short.address == address]
        tx, rx = source.report.tx[taxels], source.report.rx[taxels]
        matrix = build_shorts_matrix(tx, rx, remaining[taxels], board_shorts)
        boards.append({"taxels": taxels, "matrix": matrix})
    return [{"kind": "mix_signal", "boards": boards}]


def _translate_lag(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    return [{"kind": "lag", "seconds": source.expand_values(reported_effect, "seconds")}]


def _translate_pose_error(source: ExportSource, reported_effect: ReportedEffect, form: str) -> list[Step]:
    raise UntranslatableError(POSE)


_TRANSLATORS: Final[Mapping[str, Callable[[ExportSource, ReportedEffect, str], list[Step]]]] = MappingProxyType(
    {
        "contact_propagation": _translate_propagation,
        "stiffness": _translate_stiffness,
        "hysteresis": _translate_hysteresis,
        "proximity": _translate_proximity,
        "gain_mismatch": _translate_gain,
        "nonlinearity": _translate_nonlinearity,
        "saturation": _translate_saturation,
        "electrode_crosstalk": _translate_crosstalk,
        "baseline_drift": _translate_drift,
        "dropout": _translate_dropout,
        "latency": _translate_lag,
        "pose_error": _translate_pose_error,
    }
)
