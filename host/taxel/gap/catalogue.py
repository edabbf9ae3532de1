"""The effects that are tried, by the names of the report page, each in its forms and scopes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType

from taxel.gap.effects.baseline_drift import BaselineDrift
from taxel.gap.effects.contact_propagation import ContactPropagation
from taxel.gap.effects.effect import BOARD, HAND, OBJECT, TAXEL, Effect, Prior
from taxel.gap.effects.electrode_crosstalk import ElectrodeCrosstalk
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.effects.hysteresis import Hysteresis
from taxel.gap.effects.latency import Latency
from taxel.gap.effects.noise import Noise
from taxel.gap.effects.pillar_propagation import PillarPropagation
from taxel.gap.effects.pose_error import PoseError
from taxel.gap.effects.proximity import Proximity
from taxel.gap.effects.saturation import Saturation
from taxel.gap.effects.sticking import Sticking
from taxel.gap.effects.stiffness import Sinking, Stiffness
from taxel.gap.errors import GapInputError

DROPOUT = "dropout"

CATALOGUE: Mapping[str, tuple[Effect, ...]] = MappingProxyType(
    {
        "contact_propagation": (
            *(ContactPropagation(variant) for variant in ("kept", "added", "kept even", "added even")),
            PillarPropagation(),
        ),
        "electrode_crosstalk": (
            ElectrodeCrosstalk("lines"),
            ElectrodeCrosstalk("network"),
            ElectrodeCrosstalk("network", BOARD),
        ),
        "noise": (Noise(HAND), Noise(BOARD)),
        "gain_mismatch": (GainMismatch(BOARD, 0.5), GainMismatch(TAXEL, 0.3)),
        "stiffness": (Stiffness(HAND), Stiffness(BOARD), Sinking(HAND), Sinking(BOARD)),
        "baseline_drift": (BaselineDrift(HAND), BaselineDrift(BOARD)),
        "hysteresis": (*(Hysteresis(variant) for variant in ("drop", "gap", "force", "depth", "more")), Sticking()),
        "saturation": (Saturation("clip"), Saturation("soft")),
        "proximity": (Proximity("exponential"), Proximity("linear")),
        DROPOUT: (),  # found by looking, see `taxel.gap.dropped`
        "pose_error": (PoseError(OBJECT), PoseError(BOARD)),
        "latency": (Latency(BOARD), Latency(BOARD, "lag")),
    }
)
"""Forms of every effect."""

LIKE: Mapping[str, tuple[Effect, ...]] = MappingProxyType({"stiffness": (Stiffness(TAXEL),)})
"""Further forms that are not searched, since no press of a usual campaign tells them from one that is: a taxel's
stiffness from its gain. Whether these presses would is asked when something was found."""


def chosen(
    without: Collection[str] = (), priors: Mapping[str, Mapping[str, Prior]] = MappingProxyType({})
) -> dict[str, tuple[Effect, ...]]:
    """The catalogue less some effects. priors: what is known of parameters, by effect and name.

    Raises GapInputError for a name that it lacks.
    """
    for name in without:
        if name not in CATALOGUE:
            names = ", ".join(CATALOGUE)
            raise GapInputError("--without", f"one of {names}", repr(name), "correct the name")
    return {
        name: tuple(form.with_priors(priors[name]) if name in priors else form for form in forms)
        for name, forms in CATALOGUE.items()
        if name not in without
    }
