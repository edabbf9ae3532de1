"""What somebody knows of effects beforehand: a file of values with standard deviations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any, Final

from taxel.gap.effects import catalogue
from taxel.gap.effects.effect import Parameter, Prior
from taxel.gap.errors import GapInputError
from taxel.hand.errors import format_path
from taxel.input_files import TextError, parse_toml, read_regular_file

LARGEST_BYTES: Final = 1 << 20

Priors = Mapping[str, Mapping[str, Prior]]


def read_priors(path: str | PathLike[str]) -> Priors:
    """Read a TOML file with a table for each effect, such as `[contact_propagation]` and in it
    `spread_mm = { value = 2.0, std = 0.5 }`.

    Raises GapInputError of one line, OSError.
    """
    file = Path(path)
    try:
        tables = parse_toml(read_regular_file(file, LARGEST_BYTES))
    except TextError as error:
        raise GapInputError(f"{file}: {error.position}", error.expected, error.found, "correct the line") from None
    return {name: _effect(str(file), name, table) for name, table in tables.items()}


def _effect(file: str, name: str, table: Any) -> dict[str, Prior]:
    if name not in catalogue.all_effects() or not catalogue.all_effects()[name]:
        known = ", ".join(effect for effect, forms in catalogue.all_effects().items() if forms)
        raise GapInputError(
            f"{file}: [{format_path(name)[:60]}]", f"one of {known}", "another name", "correct the name"
        )
    if not isinstance(table, dict):
        raise GapInputError(f"{file}: {name}", "a table", type(table).__name__, f"write [{name}] above its parameters")
    parameters: dict[str, Parameter] = {}
    for one in (one for form in catalogue.all_effects()[name] for one in form.own_parameters()):
        other = parameters.get(one.name, one)
        parameters[one.name] = replace(one, low=min(one.low, other.low), high=max(one.high, other.high))
    return {key: _prior(f"{file}: {name}.{key}", parameters, key, value) for key, value in table.items()}


def _prior(where: str, parameters: Mapping[str, Parameter], key: str, value: Any) -> Prior:
    if key not in parameters:
        raise GapInputError(where, f"one of {', '.join(parameters)}", "another parameter", "correct the name")
    if not isinstance(value, dict) or set(value) != {"value", "std"}:
        raise GapInputError(where, "{ value = ..., std = ... }", repr(value)[:40], "give both numbers")
    numbers = [value["value"], value["std"]]
    if any(isinstance(one, bool) or not isinstance(one, int | float) or not abs(one) < 1e300 for one in numbers):
        raise GapInputError(where, "two finite numbers", repr(value)[:40], "correct the numbers")
    known = parameters[key]
    if not known.low <= value["value"] <= known.high or value["std"] <= 0:
        expected = f"value from {known.low:g} to {known.high:g} {known.unit}, std above 0"
        raise GapInputError(where, expected, f"{value['value']:g} and {value['std']:g}", "correct the numbers")
    return Prior(float(value["value"]), float(value["std"]))
