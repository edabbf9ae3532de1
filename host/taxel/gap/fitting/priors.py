"""Priors on effect parameters, read from a TOML file of a user."""

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

MAX_FILE_BYTES: Final = 1 << 20
"""Largest accepted size of the file, bytes (chosen): far above a table of all parameters of the catalogue."""

Priors = Mapping[str, Mapping[str, Prior]]
"""Prior of each parameter, by the names of effect and parameter."""


def read_priors(path: str | PathLike[str]) -> Priors:
    """Read priors from a TOML file with one table for each effect.

    Example: the table `[contact_propagation]` with the line `spread_mm = { value = 2.0, std = 0.5 }`; value and
    standard deviation have the unit of the parameter. Raises GapInputError with a one-line message for invalid content,
    and OSError for an unreadable file.
    """
    file = Path(path)
    try:
        tables = parse_toml(read_regular_file(file, MAX_FILE_BYTES))
    except TextError as error:
        raise GapInputError(f"{file}: {error.position}", error.expected, error.found, "correct the line") from None
    return {name: _parse_effect(str(file), name, table) for name, table in tables.items()}


def _parse_effect(file: str, name: str, table: Any) -> dict[str, Prior]:
    """Return the priors of one table, by parameter. Raises GapInputError for an unknown effect or parameter, and for
    invalid numbers.

    file: path for the message. name: name of the table, an effect. table: content of the table.
    """
    if name not in catalogue.all_effects() or not catalogue.all_effects()[name]:
        known = ", ".join(effect for effect, forms in catalogue.all_effects().items() if forms)
        raise GapInputError(
            f"{file}: [{format_path(name)[:60]}]", f"one of {known}", "another name", "correct the name"
        )
    if not isinstance(table, dict):
        raise GapInputError(f"{file}: {name}", "a table", type(table).__name__, f"write [{name}] above its parameters")
    # Forms of an effect may have different bounds of the same parameter: a prior may lie within the bounds of any form.
    parameters: dict[str, Parameter] = {}
    for parameter in (parameter for form in catalogue.all_effects()[name] for parameter in form.own_parameters()):
        other = parameters.get(parameter.name, parameter)
        parameters[parameter.name] = replace(
            parameter, low=min(parameter.low, other.low), high=max(parameter.high, other.high)
        )
    return {key: _parse_prior(f"{file}: {name}.{key}", parameters, key, value) for key, value in table.items()}


def _parse_prior(where: str, parameters: Mapping[str, Parameter], key: str, value: Any) -> Prior:
    """Return the prior of the parameter `key`. Raises GapInputError for an unknown parameter and for invalid numbers.

    where: position for the message. parameters: parameters of the effect by name. value: content of the entry.
    """
    if key not in parameters:
        raise GapInputError(where, f"one of {', '.join(parameters)}", "another parameter", "correct the name")
    if not isinstance(value, dict) or set(value) != {"value", "std"}:
        raise GapInputError(where, "{ value = ..., std = ... }", repr(value)[:40], "give both numbers")
    numbers = [value["value"], value["std"]]
    if any(
        isinstance(number, bool) or not isinstance(number, int | float) or not abs(number) < 1e300 for number in numbers
    ):
        raise GapInputError(where, "two finite numbers", repr(value)[:40], "correct the numbers")
    known = parameters[key]
    if not known.low <= value["value"] <= known.high or value["std"] <= 0:
        expected = f"value from {known.low:g} to {known.high:g} {known.unit}, std above 0"
        raise GapInputError(where, expected, f"{value['value']:g} and {value['std']:g}", "correct the numbers")
    return Prior(float(value["value"]), float(value["std"]))
