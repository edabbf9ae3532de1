"""File of the results of a check, for inspection and for the common score of several runs."""

import gzip
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

from taxel.blind.errors import BlindRunError
from taxel.blind.results import ParameterComparison, ReportedVerdict, WorldResult
from taxel.blind.world import World
from taxel.input_files import parse_json, read_regular_file
from taxel.input_files.gzip_text import expand_gzip
from taxel.output import write_whole

RECORDS: Final = "answers.jsonl.gz"
"""Name of the file in the folder of a check."""

_BYTES_MAX: Final = 1 << 26
"""Largest file, also after expansion, bytes; a world takes 4 kB."""


def write_records(path: Path, results: Iterable[WorldResult]) -> None:
    """Write the results of worlds as one JSON object per line, compressed by gzip; numbers have six digits.

    Equal results give equal bytes.
    """
    lines = [json.dumps(_result_to_json(result)) + "\n" for result in results]
    write_whole(path, gzip.compress("".join(lines).encode(), mtime=0))


def read_records(path: Path) -> list[WorldResult]:
    """Read the results of worlds from a file of `write_records`. Raises BlindRunError for any other file."""
    try:
        lines = expand_gzip(read_regular_file(path, _BYTES_MAX), _BYTES_MAX).splitlines()
        if not lines:
            raise ValueError("no result in the file")
        return [_result_from_json(parse_json(line)) for line in lines]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        found = f"{type(error).__name__}: {error}"
        remedy = "give the answers.jsonl.gz of a check"
        raise BlindRunError(str(path), "the results of a blind check", found, remedy) from None


def merge_results(first: Sequence[WorldResult], second: Sequence[WorldResult], source: str) -> list[WorldResult]:
    """Concatenate the results of two runs of the blind check. source: origin of the second run, for messages.

    Raises BlindRunError if the runs have different versions of the diagnosis or worlds in common.
    """
    require_version(list_diagnosis_versions(first), second, source)
    if {result.world.salt for result in first} & {result.world.salt for result in second}:
        raise BlindRunError(source, "results of another run", "the same worlds", "give each run once")
    return [*first, *second]


def list_diagnosis_versions(results: Iterable[WorldResult]) -> set[str]:
    """Return the set of versions of the diagnosis that made the reports, without the worlds that have no report."""
    return {result.diagnosis_version for result in results if not result.error}


def require_version(versions: set[str], results: Sequence[WorldResult], source: str) -> None:
    """Raise BlindRunError unless `results` and `versions` contain at most one version of the diagnosis in total.

    source: origin of the results, for the message.
    """
    found = sorted(versions | list_diagnosis_versions(results))
    if len(found) > 1:
        remedy = "score the runs separately, because a score refers to one version"
        raise BlindRunError(source, "results of the same version of the diagnosis", f"{', '.join(found)}", remedy)


def _round(value: Any) -> Any:
    """Round all floating-point numbers of a nested JSON value to six digits."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {key: _round(item) for key, item in value.items()}
    return [_round(item) for item in value] if isinstance(value, list | tuple) else value


def _result_to_json(result: WorldResult) -> dict[str, Any]:
    """Convert the result of one world to a JSON record; the keys are those of the file format."""
    comparison = {
        "named": _verdict_to_json(result.verdict),
        "gap": result.gap,
        "floor": result.floor,
        "runtime_s": result.runtime_s,
        "shrink": result.shrink,
        "simpler": dict(result.baseline_verdicts),
        "parameters": [_parameter_to_json(parameter) for parameter in result.parameters],
        "found_places": result.is_location_found,
        "idle": result.unobservable_causes,
        "without": _optional_verdict_to_json(result.verdict_withheld),
        "shuffled": _optional_verdict_to_json(result.verdict_shuffled),
        "decoy": _optional_verdict_to_json(result.verdict_decoy),
        "seeds": [_verdict_to_json(verdict) for verdict in result.verdicts_by_seed],
        "error": result.error,
        "blindfold": result.isolation,
        "diagnosis": result.diagnosis_version,
    }
    return {"world": result.world.to_json(), **_round(comparison)}


def _result_from_json(data: dict[str, Any]) -> WorldResult:
    """Create the result of one world from its JSON record, which `_result_to_json` has made."""
    return WorldResult(
        World.from_json(data["world"]),
        _verdict_from_json(data["named"]),
        gap=data["gap"],
        floor=data["floor"],
        runtime_s=data["runtime_s"],
        shrink=None if data["shrink"] is None else tuple(data["shrink"]),
        baseline_verdicts=data["simpler"],
        parameters=tuple(_parameter_from_json(parameter) for parameter in data["parameters"]),
        is_location_found=data["found_places"],
        unobservable_causes=_read_texts(data["idle"]),
        verdict_withheld=_optional_verdict_from_json(data["without"]),
        verdict_shuffled=_optional_verdict_from_json(data["shuffled"]),
        verdict_decoy=_optional_verdict_from_json(data["decoy"]),
        verdicts_by_seed=tuple(_verdict_from_json(verdict) for verdict in data["seeds"]),
        error=data["error"],
        isolation=data["blindfold"],
        diagnosis_version=data["diagnosis"],
    )


def _verdict_to_json(verdict: ReportedVerdict) -> dict[str, Any]:
    """Convert a verdict of the diagnosis to JSON values; the keys are those of the file format."""
    return {
        "status": verdict.status,
        "effects": verdict.effects,
        "rivals": verdict.confounded_with_first,
        "alike": dict(verdict.confounded_with),
    }


def _optional_verdict_to_json(verdict: ReportedVerdict | None) -> dict[str, Any] | None:
    """Convert a verdict to JSON values; None for a diagnosis that was not made."""
    return None if verdict is None else _verdict_to_json(verdict)


def _verdict_from_json(data: dict[str, Any]) -> ReportedVerdict:
    """Create a verdict of the diagnosis from JSON values, which `_verdict_to_json` has made."""
    confounded = {name: _read_texts(names) for name, names in data["alike"].items()}
    return ReportedVerdict(data["status"], _read_texts(data["effects"]), _read_texts(data["rivals"]), confounded)


def _read_texts(value: Any) -> tuple[str, ...]:
    """Return a list of strings as a tuple. Raises TypeError for any other value: a string would become its letters."""
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise TypeError("a list of names is no list of texts")
    return tuple(value)


def _optional_verdict_from_json(data: dict[str, Any] | None) -> ReportedVerdict | None:
    """Create a verdict from JSON values; None for a diagnosis that was not made."""
    return None if data is None else _verdict_from_json(data)


_PARAMETER_KEYS: Final = {
    "effect": "effect",
    "emulator_effect": "form",
    "name": "name",
    "unit": "unit",
    "estimate": "found",
    "truth": "true",
    "low": "low",
    "high": "high",
    "is_reference": "reference",
}
"""Keys of a parameter comparison in the file, by field."""


def _parameter_to_json(parameter: ParameterComparison) -> dict[str, Any]:
    """Convert the estimated and true value of a parameter to JSON values; the keys are those of the file format."""
    return {key: getattr(parameter, field) for field, key in _PARAMETER_KEYS.items()}


def _parameter_from_json(data: dict[str, Any]) -> ParameterComparison:
    """Create the comparison of an estimated and a true parameter from JSON values of `_parameter_to_json`."""
    return ParameterComparison(**{field: data[key] for field, key in _PARAMETER_KEYS.items()})
