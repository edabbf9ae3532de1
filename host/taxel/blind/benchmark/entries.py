"""The diagnoses that the benchmark scores: those of the project, and those of other packages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from numbers import Real
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from taxel.blind.hidden import UNKNOWN
from taxel.gap.calibration.calibration import NO_GAP
from taxel.gap.effects.catalogue import all_effects
from taxel.plugins import DIAGNOSES, PluginError, list_plugin_names, load_plugin

OWN_ENTRIES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "diagnosis": "taxel.blind.benchmark.entries:diagnose_by_comparison",
        "check list": "taxel.blind.benchmark.entries:diagnose_by_rules",
        "least squares": "taxel.blind.benchmark.least_squares:diagnose_by_least_squares",
    }
)
"""Module and function of each diagnosis of the project, by name."""

Entry = Callable[[Path, Path, int], Mapping[str, float]]
"""Diagnosis: function of the real dataset, the simulated dataset and a seed that returns probabilities by cause."""


def load_entry(name: str) -> Entry:
    """Load a diagnosis by its name. Raises PluginError for an unknown name."""
    names = list_plugin_names(DIAGNOSES, OWN_ENTRIES)
    if name not in names:
        raise PluginError(f"--entry: expected one of {', '.join(names)}, found '{name}'")
    entry: Entry = load_plugin(DIAGNOSES, name, OWN_ENTRIES)
    return entry


def check_answer(answer: Mapping[str, Any], name: str) -> dict[str, float]:
    """Return the probabilities in the answer of a diagnosis as floats, by cause.

    name: name of the diagnosis in messages. Raises PluginError for an unknown effect or a value outside 0 to 1.
    """
    known = {*all_effects(), UNKNOWN, NO_GAP}
    for effect, value in answer.items():
        if effect not in known:
            raise PluginError(f"diagnosis '{name}': expected names of effects, unknown or no_gap, found '{effect}'")
        if not isinstance(value, Real) or not 0.0 <= float(value) <= 1.0:
            raise PluginError(f"diagnosis '{name}': {effect}: expected a probability, found {value!r}")
    return {effect: float(value) for effect, value in answer.items()}


def diagnose_by_comparison(real: Path, sim: Path, seed: int) -> dict[str, float]:
    """Return the calibrated probabilities of the causes, as `taxel gap diagnose` computes them."""
    from taxel.gap.comparison.compare import compare

    return compare(real, sim, seed=seed).compute_probabilities()


def diagnose_by_rules(real: Path, sim: Path, seed: int) -> dict[str, float]:
    """Return probability 1 for the cause that an engineer's check list names (`taxel.blind.baselines`).

    Whether there is a gap is taken from the diagnosis.
    """
    from taxel.blind.baselines import compute_baseline_verdicts
    from taxel.gap.diagnosis import diagnose

    return {compute_baseline_verdicts(diagnose(real, sim, seed=seed))["rules"]: 1.0}
