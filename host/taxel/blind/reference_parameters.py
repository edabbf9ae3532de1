"""Reference parameters: the best fit to noise-free indentations.

The score uses them as the truth for effects whose model in the diagnosis differs from the model in the emulator.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from taxel.blind.hidden import Cause
from taxel.blind.scoring_rules import is_clear, model_key
from taxel.gap.data.align import fit_additional_shift
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import all_effects
from taxel.gap.effects.effect import Effect
from taxel.gap.effects.latency import is_delay
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import start_effect
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.report.effects import build_parameter_entries


def select_models_to_fit(cause: Cause, report: Mapping[str, Any]) -> set[str]:
    """Select the effect models of a report whose true parameters must be found by a fit to noise-free data.

    cause: the hidden cause of the world. Returns the keys of the models that the report names for this cause. The set
    is empty if the true parameters follow from the cause, or if the gap is not clear.
    """
    if cause.parameters or not is_clear(report):
        return set()
    named = [entry for entry in report.get("effects", []) if entry["name"] == cause.name and entry["in_verdict"]]
    return {model_key(entry) for entry in named}


def fit_reference_parameters(real: Path, sim: Path, name: str, models: Collection[str]) -> dict[str, dict[str, float]]:
    """Fit the effect `name` to noise-free data; the fitted parameters serve as the true values in the score.

    real, sim: datasets. models: keys of the models to fit. Returns the parameters by model key, such as {"kept hand":
    {"spread_mm": 2.1}}; empty for an effect without a fitted model. Raises DatasetError and GapInputError with one-line
    messages.
    """
    with threadpool_limits(limits=1):
        pair = read_pair(real, sim)
        fit_data = prepare_pair(pair)
        parameters: dict[str, dict[str, float]] = {}
        for effect in all_effects()[name]:
            key = f"{effect.variant} {effect.scope}"
            if key not in models or effect.find_unavailable_reason(fit_data.state):
                continue
            fitted_effect = _fit(fit_data, effect)
            parameters[key] = {
                label: _number(entry) for label, entry in build_parameter_entries(pair, fitted_effect).items()
            }
    return parameters


def _fit(fit_data: FitData, effect: Effect) -> FittedEffect:
    """Fit one effect to the data; as in a diagnosis, the frames are aligned in time again after the first fit."""
    model = fit_data.fit_in_sample(CompositeModel((start_effect(fit_data.state, effect),))).composite
    if not is_delay(effect):
        shift, model = fit_additional_shift(fit_data, model, ())
        model = fit_data.shift_time(shift).fit_in_sample(model).composite
    return model.fitted_effects[0]


def _number(entry: dict[str, Any]) -> float:
    """Return the value of a parameter in a report as a number."""
    return float(np.asarray(entry["value"], dtype=np.float64))
