"""The exported Python module: the code of `skin_steps.py` and `skin_effects.py` with the parameters of a report."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, Final

import numpy as np

from taxel.gap.export.common import ExportSource
from taxel.gap.export.translation import Translation

PLACEHOLDER: Final = 'json.loads("{}")  # PARAMETERS'
"""Text in `skin_effects.py` that is replaced by the parameters."""

STEPS_IMPORT: Final = re.compile(r"^from taxel\.gap\.export\.skin_steps import \(.*?^\)\n", re.MULTILINE | re.DOTALL)
"""Import in `skin_effects.py` that is replaced by the source text of `skin_steps.py`."""

DIGITS: Final = 9
"""Significant digits of an exported number. Chosen: more than a count of 16 bits needs (5 digits)."""


def write_python(source: ExportSource, translation: Translation, note: str) -> str:
    """Return the text of a Python file with the class `SkinEffects` and the parameters of the effects.

    translation: effects as numeric steps. note: line that states the origin of the file.
    """
    code = join_sources()
    comment = "\n".join(f"# {line}" for line in (note, *list_limits(translation)))
    parameters = _collect_parameters(source, translation)
    lines = ",\n".join(f"{json.dumps(name)}: {_write_json(value)}" for name, value in parameters.items())
    return f"{comment}\n{code.replace(PLACEHOLDER, _quote_parameters(lines))}"


def join_sources() -> str:
    """Return the sources of `skin_effects.py` and `skin_steps.py` as one module without imports of this package."""
    folder = files("taxel.gap.export")
    steps, effects = (
        folder.joinpath(name).read_text(encoding="utf-8") for name in ("skin_steps.py", "skin_effects.py")
    )
    body = steps.partition("import numpy.typing as npt\n")[2].strip()
    return STEPS_IMPORT.sub(lambda _: f"{body}\n", effects, count=1)


def _quote_parameters(lines: str) -> str:
    """Return the Python expression that loads the parameters from a raw string literal. lines: JSON text."""
    return 'json.loads(r"""{' + lines.replace('"""', '""\\u0022') + '}""")'


def list_limits(translation: Translation) -> list[str]:
    """Return one line with the reason for each effect that the export approximates or does not express."""
    lines = [f"approximated: {name}: {reason}" for name, reason in translation.approximated.items()]
    return lines + [f"not expressed: {name}: {reason}" for name, reason in translation.not_expressed.items()]


def format_tables(tables: Mapping[str, Sequence[str]]) -> str:
    """Return the Python source text of dictionaries. tables: source lines of the entries, by name of the dictionary."""
    return "\n".join(f"{name} = {{\n" + "".join(f"{line}\n" for line in lines) + "}" for name, lines in tables.items())


def round_number(value: float) -> float:
    """Round a value to `DIGITS` significant digits."""
    return float(f"{value:.{DIGITS}g}")


def _collect_parameters(source: ExportSource, translation: Translation) -> dict[str, Any]:
    """Return the values of the dictionary `PARAMETERS` in the exported module, by name.

    An empty list stands for an effect that is absent; None for an unknown sensor model.
    """
    report, model = source.report, source.model
    groups = [
        _number_line_groups(source, line)
        for line in (np.arange(source.n), report.tx, report.rx, np.zeros(source.n, int))
    ]
    return {
        "taxels": {"board": source.board, "tx": report.tx, "rx": report.rx},
        "boards": source.boards,
        "sensor_model": None
        if model is None
        else {
            "baseline_counts": model.baseline_counts,
            "full_scale_counts": model.full_scale_drop_counts,
            "half_force_n": model.half_force_n,
        },
        "steps": translation.steps,
        "delay_s": translation.delay_s if translation.delay_s.any() else [],
        "noise": translation.noise if translation.noise.any() else [],
        "noise_groups": groups if translation.noise.any() else [],
        "lost": translation.lost if translation.lost.any() else [],
        "stuck": translation.stuck,
        "effects": translation.expressed,
        "approximated": translation.approximated,
        "not_expressed": translation.not_expressed,
    }


def _number_line_groups(source: ExportSource, line: Any) -> list[int]:
    """Return for each taxel the number of its group, [n] (n taxels): the taxels of one board with an equal value of
    `line`.

    line: [n], such as the TX line of each taxel.
    """
    return [
        int(one) for one in np.unique(np.column_stack([source.board, line]), axis=0, return_inverse=True)[1].ravel()
    ]


def _write_json(value: Any) -> str:
    """Return a value as compact JSON text, with numbers rounded to `DIGITS` significant digits."""
    return json.dumps(_convert_to_json(value), separators=(",", ":"), allow_nan=False)


def _convert_to_json(value: Any) -> Any:
    """Return a value with arrays and tuples converted to lists, and with rounded numbers."""
    if isinstance(value, np.ndarray):
        return _convert_to_json(value.tolist())
    if isinstance(value, Mapping):
        return {name: _convert_to_json(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_convert_to_json(one) for one in value]
    return round_number(value) if isinstance(value, float) else value
