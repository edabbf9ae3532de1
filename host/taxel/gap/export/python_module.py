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
"""Text of `skin_effects.py` that the parameters replace."""

STEPS_IMPORT: Final = re.compile(r"^from taxel\.gap\.export\.skin_steps import \(.*?^\)\n", re.MULTILINE | re.DOTALL)

DIGITS: Final = 9
"""Significant digits of an exported number: more than a count of 16 bits needs."""


def write_python(source: ExportSource, translation: Translation, note: str) -> str:
    """The text of a Python file with the class `SkinEffects`. note: origin of the file, one line."""
    code = join_sources()
    comment = "\n".join(f"# {line}" for line in (note, *list_limits(translation)))
    parameters = _parameters(source, translation)
    lines = ",\n".join(f"{json.dumps(name)}: {_text(value)}" for name, value in parameters.items())
    return f"{comment}\n{code.replace(PLACEHOLDER, _quoted(lines))}"


def join_sources() -> str:
    """The source text of `skin_effects.py` with that of `skin_steps.py` in the place of the import, one module."""
    folder = files("taxel.gap.export")
    steps, effects = (
        folder.joinpath(name).read_text(encoding="utf-8") for name in ("skin_steps.py", "skin_effects.py")
    )
    body = steps.partition("import numpy.typing as npt\n")[2].strip()
    return STEPS_IMPORT.sub(lambda _: f"{body}\n", effects, count=1)


def _quoted(lines: str) -> str:
    return 'json.loads(r"""{' + lines.replace('"""', '""\\u0022') + '}""")'


def list_limits(translation: Translation) -> list[str]:
    """Lines that state what an export approximates and what it cannot express."""
    lines = [f"approximated: {name}: {reason}" for name, reason in translation.approximated.items()]
    return lines + [f"not expressed: {name}: {reason}" for name, reason in translation.not_expressed.items()]


def format_tables(tables: Mapping[str, Sequence[str]]) -> str:
    """Source text of dictionaries, by name; lines of the entries of each."""
    return "\n".join(f"{name} = {{\n" + "".join(f"{line}\n" for line in lines) + "}" for name, lines in tables.items())


def round_number(value: float) -> float:
    """The value with `DIGITS` significant digits."""
    return float(f"{value:.{DIGITS}g}")


def _parameters(source: ExportSource, translation: Translation) -> dict[str, Any]:
    report, model = source.report, source.model
    groups = [
        _line_groups(source, line) for line in (np.arange(source.n), report.tx, report.rx, np.zeros(source.n, int))
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


def _line_groups(source: ExportSource, line: Any) -> list[int]:
    """Number of the group of each taxel: of its line on its board."""
    return [
        int(one) for one in np.unique(np.column_stack([source.board, line]), axis=0, return_inverse=True)[1].ravel()
    ]


def _text(value: Any) -> str:
    return json.dumps(_plain(value), separators=(",", ":"), allow_nan=False)


def _plain(value: Any) -> Any:
    """JSON values with rounded numbers."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {name: _plain(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return round_number(value) if isinstance(value, float) else value
