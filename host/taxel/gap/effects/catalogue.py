"""The catalogue: all effects by name, each with its forms and scopes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cache
from types import MappingProxyType

from taxel.gap.effects.baseline_drift import FROM_CLOSING, BaselineDrift
from taxel.gap.effects.contact_propagation import ContactPropagation
from taxel.gap.effects.effect import BOARD, HAND, OBJECT, TAXEL, Effect, Prior
from taxel.gap.effects.electrode_crosstalk import ElectrodeCrosstalk
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.effects.hysteresis import Hysteresis
from taxel.gap.effects.latency import Latency
from taxel.gap.effects.noise import Noise
from taxel.gap.effects.nonlinearity import POLYNOMIAL, Nonlinearity
from taxel.gap.effects.pillar_propagation import PillarPropagation
from taxel.gap.effects.pose_error import PoseError
from taxel.gap.effects.proximity import Proximity
from taxel.gap.effects.saturation import Saturation
from taxel.gap.effects.signal_propagation import CountsPropagation, SignalPropagation
from taxel.gap.effects.sticking import Sticking
from taxel.gap.effects.stiffness import CurvedStiffness, Sinking, Stiffness
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.state import State
from taxel.plugins import EFFECTS, PluginError, list_plugin_names, load_plugin

DROPOUT = "dropout"

INSPECTED_EFFECTS = (DROPOUT,)
"""Names of the effects that are found by inspection; their values are not fitted."""

PRESSURE_FORMS = ("kept", "added", "kept even", "added even", "kept power", "added power")
"""Forms of contact propagation with a spread of the pressure."""

SIGNAL_FORMS = ("signal", "signal added", "signal power", "signal added power")
"""Forms of contact propagation with a spread of the signal, for a simulation without contact forces."""

COUNTS_FORMS = ("counts power", "counts added power")
"""The same for a simulation with contact forces: its counts spread. Exponential kernels have the shape 1."""

Forms = Mapping[str, Sequence[Effect]]
"""Forms of each effect, by name of the effect."""

OWN_EFFECTS: Mapping[str, tuple[Effect, ...]] = MappingProxyType(
    {
        "contact_propagation": (
            *(ContactPropagation(variant) for variant in PRESSURE_FORMS),
            PillarPropagation(),
            *(CountsPropagation(variant) for variant in COUNTS_FORMS),
            *(SignalPropagation(variant) for variant in SIGNAL_FORMS),
        ),
        "electrode_crosstalk": (
            ElectrodeCrosstalk("lines"),
            ElectrodeCrosstalk("network"),
            ElectrodeCrosstalk("network", BOARD),
        ),
        "noise": (Noise(HAND), Noise(BOARD)),
        "gain_mismatch": (GainMismatch(BOARD, 0.5), GainMismatch(TAXEL, 0.3)),
        "stiffness": (Stiffness(HAND), CurvedStiffness(HAND), Stiffness(BOARD), Sinking(HAND), Sinking(BOARD)),
        "nonlinearity": (Nonlinearity(), Nonlinearity(HAND, POLYNOMIAL)),
        "baseline_drift": tuple(BaselineDrift(scope, form) for scope in (HAND, BOARD) for form in ("", FROM_CLOSING)),
        "hysteresis": (*(Hysteresis(variant) for variant in ("drop", "gap", "force", "depth", "more")), Sticking()),
        "saturation": (Saturation("clip"), Saturation("soft"), Saturation("smooth")),
        "proximity": (Proximity("exponential"), Proximity("linear"), Proximity("power")),
        DROPOUT: (),  # found by inspection, see `taxel.gap.effects.dropout_inspection`
        "pose_error": (PoseError(OBJECT), PoseError(BOARD)),
        "latency": (Latency(BOARD), Latency(BOARD, "lag")),
    }
)
"""Forms of each effect of the project, by name of the effect."""

UNSEARCHED_FORMS: Mapping[str, tuple[Effect, ...]] = MappingProxyType({"stiffness": (Stiffness(TAXEL),)})
"""Further forms, by name of the effect, that the search does not contain.

The stiffness of single taxels is usually not identifiable from their gains. The similarity of effects includes these
forms, so that the report states whether the given contacts separate them.
"""


_ADDED: dict[str, tuple[Effect, ...]] = {}


def add_effects(effects: Mapping[str, tuple[Effect, ...]]) -> None:
    """Add effects to the catalogue of this process; an added effect replaces an earlier added effect with its name."""
    _ADDED.update(effects)


def all_effects() -> Mapping[str, tuple[Effect, ...]]:
    """Return the forms of all effects by name: effects of the project, of other packages (entry points), and of
    `add_effects`.

    An entry point of the group `taxel.effects` refers to a sequence of `Effect` objects whose `name` is the name of the
    entry point. Raises `PluginError` for an entry point that cannot be loaded or refers to something else.
    """
    added = list_plugin_names(EFFECTS, dict.fromkeys(OWN_EFFECTS, ""))[len(OWN_EFFECTS) :]
    return MappingProxyType({**OWN_EFFECTS, **{name: _load_plugin_effect(name) for name in added}, **_ADDED})


@cache
def _load_plugin_effect(name: str) -> tuple[Effect, ...]:
    """Return the forms of an effect that the entry point `name` of another package provides. Cached.

    Raises `PluginError` if the entry point cannot be loaded, refers to anything but a non-empty sequence of `Effect`
    objects, or refers to an effect with another name.
    """
    variants = load_plugin(EFFECTS, name)
    if not isinstance(variants, Sequence) or not variants or not all(isinstance(item, Effect) for item in variants):
        raise PluginError(
            f"entry point '{name}' of group '{EFFECTS}': expected a sequence of taxel.gap.effects.effect.Effect, "
            f"found {type(variants).__name__}; correct the package that adds it"
        )
    if any(variant.name != name for variant in variants):
        raise PluginError(
            f"entry point '{name}' of group '{EFFECTS}': expected effects with name '{name}', found "
            f"'{next(variant.name for variant in variants if variant.name != name)}'; use one name in both places"
        )
    return tuple(variants)


def choose_effects(
    without: Collection[str] = (), priors: Mapping[str, Mapping[str, Prior]] = MappingProxyType({})
) -> dict[str, tuple[Effect, ...]]:
    """Return the forms of all effects except the excluded effects, by name of the effect.

    without: names of excluded effects. priors: priors of parameters, by effect and parameter name. Raises
    `GapInputError` for an excluded name that no effect has.
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
    """Return why none of the forms of an effect can be fitted to the pair of datasets of a state.

    Of several reasons, the reason of the first form is returned. The string is empty if at least one form can be
    fitted, or if the effect has no forms because it is found by inspection.
    """
    reasons = [form.find_unavailable_reason(state) for form in forms]
    return "" if not reasons or not all(reasons) else reasons[0]
