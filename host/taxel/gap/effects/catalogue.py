"""The effects that are tried, by the names of the report page, each in its forms and scopes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cache
from types import MappingProxyType

from taxel.gap.effects.baseline_drift import BaselineDrift
from taxel.gap.effects.contact_propagation import ContactPropagation
from taxel.gap.effects.effect import BOARD, HAND, OBJECT, TAXEL, Effect, Prior
from taxel.gap.effects.electrode_crosstalk import ElectrodeCrosstalk
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.effects.hysteresis import Hysteresis
from taxel.gap.effects.latency import Latency
from taxel.gap.effects.noise import Noise
from taxel.gap.effects.nonlinearity import Nonlinearity
from taxel.gap.effects.pillar_propagation import PillarPropagation
from taxel.gap.effects.pose_error import PoseError
from taxel.gap.effects.proximity import Proximity
from taxel.gap.effects.saturation import Saturation
from taxel.gap.effects.signal_propagation import SignalPropagation
from taxel.gap.effects.sticking import Sticking
from taxel.gap.effects.stiffness import Sinking, Stiffness
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.state import State
from taxel.plugins import EFFECTS, PluginError, list_plugin_names, load_plugin

DROPOUT = "dropout"

FIXED = (DROPOUT,)
"""Effects that are found by inspection; their values are not fitted."""

Forms = Mapping[str, Sequence[Effect]]
"""Forms of each effect by its name."""

OWN_EFFECTS: Mapping[str, tuple[Effect, ...]] = MappingProxyType(
    {
        "contact_propagation": (
            *(ContactPropagation(variant) for variant in ("kept", "added", "kept even", "added even")),
            PillarPropagation(),
            *(SignalPropagation(variant) for variant in ("signal", "signal added")),
        ),
        "electrode_crosstalk": (
            ElectrodeCrosstalk("lines"),
            ElectrodeCrosstalk("network"),
            ElectrodeCrosstalk("network", BOARD),
        ),
        "noise": (Noise(HAND), Noise(BOARD)),
        "gain_mismatch": (GainMismatch(BOARD, 0.5), GainMismatch(TAXEL, 0.3)),
        "stiffness": (Stiffness(HAND), Stiffness(BOARD), Sinking(HAND), Sinking(BOARD)),
        "nonlinearity": (Nonlinearity(),),
        "baseline_drift": (BaselineDrift(HAND), BaselineDrift(BOARD)),
        "hysteresis": (*(Hysteresis(variant) for variant in ("drop", "gap", "force", "depth", "more")), Sticking()),
        "saturation": (Saturation("clip"), Saturation("soft")),
        "proximity": (Proximity("exponential"), Proximity("linear")),
        DROPOUT: (),  # found by looking, see `taxel.gap.effects.dropped`
        "pose_error": (PoseError(OBJECT), PoseError(BOARD)),
        "latency": (Latency(BOARD), Latency(BOARD, "lag")),
    }
)
"""Variants of each effect of the project."""

LIKE: Mapping[str, tuple[Effect, ...]] = MappingProxyType({"stiffness": (Stiffness(TAXEL),)})
"""Further forms that are not searched, since no press of a usual campaign tells them from one that is: a taxel's
stiffness from its gain. Whether these presses would is asked when something was found."""


_ADDED: dict[str, tuple[Effect, ...]] = {}


def add_effects(effects: Mapping[str, tuple[Effect, ...]]) -> None:
    """Add effects to the catalogue of this process; an added effect with the same name is replaced."""
    _ADDED.update(effects)


def all_effects() -> Mapping[str, tuple[Effect, ...]]:
    """Variants of each effect: the project's own, those that other packages add by entry points, and those of
    `add_effects`.

    An entry point of the group `taxel.effects` names a sequence of `Effect` objects whose `name` is the entry point's
    name. Raises `PluginError` for an entry point that cannot be loaded or names something else.
    """
    added = list_plugin_names(EFFECTS, dict.fromkeys(OWN_EFFECTS, ""))[len(OWN_EFFECTS) :]
    return MappingProxyType({**OWN_EFFECTS, **{name: _plugin_effect(name) for name in added}, **_ADDED})


@cache
def _plugin_effect(name: str) -> tuple[Effect, ...]:
    variants = load_plugin(EFFECTS, name)
    if not isinstance(variants, Sequence) or not variants or not all(isinstance(one, Effect) for one in variants):
        raise PluginError(
            f"entry point '{name}' of group '{EFFECTS}': expected a sequence of taxel.gap.effects.effect.Effect, "
            f"found {type(variants).__name__}; correct the package that adds it"
        )
    if any(one.name != name for one in variants):
        raise PluginError(
            f"entry point '{name}' of group '{EFFECTS}': expected effects with name '{name}', found "
            f"'{next(one.name for one in variants if one.name != name)}'; use one name in both places"
        )
    return tuple(variants)


def chosen(
    without: Collection[str] = (), priors: Mapping[str, Mapping[str, Prior]] = MappingProxyType({})
) -> dict[str, tuple[Effect, ...]]:
    """The effects to be tried: all effects without the excluded ones.

    without: names of excluded effects. priors: priors of parameters, by effect and parameter name. Raises
    `GapInputError` for the name of an effect that does not exist.
    """
    effects = all_effects()
    for name in without:
        if name not in effects:
            raise GapInputError("--without", f"one of {', '.join(effects)}", repr(name), "correct the name")
    return {
        name: tuple(variant.with_priors(priors[name]) if name in priors else variant for variant in variants)
        for name, variants in effects.items()
        if name not in without
    }


def find_unavailable_reason(state: State, forms: Sequence[Effect]) -> str:
    """Reason for which no form of an effect can be tried on a pair; empty if one can, or if it is found by inspection.

    Of several reasons, that of the first form.
    """
    reasons = [form.unavailable(state) for form in forms]
    return "" if not reasons or not all(reasons) else reasons[0]
