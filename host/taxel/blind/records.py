"""Answers as lines of JSON: what a score was made of, for whoever looks into it, and to score several runs as one."""

from __future__ import annotations

import gzip
import json
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from taxel.blind.answers import Answer, Compared, Named
from taxel.blind.drawing import World
from taxel.blind.errors import BlindRunError

RECORDS: Final = "answers.jsonl.gz"
"""In a run's folder."""

_PLAIN: Final = ("gap", "floor", "runtime_s", "simpler", "found_places", "error", "blindfold", "diagnosis")
"""Fields that JSON holds as they are."""


def write_records(path: Path, answers: Iterable[Answer]) -> None:
    """One JSON object a line, gzipped: the world as it was sealed, and the answer, to six digits. The same answers make
    the same bytes.
    """
    lines = [json.dumps(_shorter(asdict(one)) | {"world": one.world.to_json()}) + "\n" for one in answers]
    path.write_bytes(gzip.compress("".join(lines).encode(), mtime=0))


def read_records(path: Path) -> list[Answer]:
    """What `write_records` wrote. Raises BlindRunError."""
    try:
        lines = gzip.decompress(path.read_bytes()).decode().splitlines()
        if not lines:
            raise ValueError("no answer in it")
        return [_answer(json.loads(line)) for line in lines]
    except (OSError, EOFError, zlib.error, ValueError, KeyError, TypeError) as error:
        found = f"{type(error).__name__}: {error}"
        raise BlindRunError(str(path), "the answers of a blind check", found, "give its answers.jsonl.gz") from None


def together(own: Sequence[Answer], others: Sequence[Answer], where: str) -> list[Answer]:
    """Answers of two runs. where: the other's, for the message. Raises BlindRunError if they are of two diagnoses, or
    of the same worlds.
    """
    require_diagnosis(versions(own), others, where)
    if {one.world.salt for one in own} & {one.world.salt for one in others}:
        raise BlindRunError(where, "answers of another run", "the same worlds", "give each run once")
    return [*own, *others]


def versions(answers: Iterable[Answer]) -> set[str]:
    """Of the diagnoses that answered."""
    return {one.diagnosis for one in answers if not one.error}


def require_diagnosis(known: set[str], others: Sequence[Answer], where: str) -> None:
    """Raises BlindRunError unless all are of one diagnosis."""
    found = sorted(known | versions(others))
    if len(found) > 1:
        remedy = "score them apart: figures are of one diagnosis"
        raise BlindRunError(where, "answers of the same diagnosis", f"of {', '.join(found)}", remedy)


def _shorter(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {key: _shorter(one) for key, one in value.items()}
    return [_shorter(one) for one in value] if isinstance(value, list | tuple) else value


def _answer(data: dict[str, Any]) -> Answer:
    values: dict[str, Any] = {key: data[key] for key in _PLAIN}
    values |= {key: None if data[key] is None else _named(data[key]) for key in ("without", "shuffled", "decoy")}
    values["shrink"] = None if data["shrink"] is None else tuple(data["shrink"])
    values["idle"] = tuple(data["idle"])
    values["parameters"] = tuple(Compared(**one) for one in data["parameters"])
    values["seeds"] = tuple(_named(one) for one in data["seeds"])
    return Answer(World.from_json(data["world"]), _named(data["named"]), **values)


def _named(data: dict[str, Any]) -> Named:
    alike = {name: tuple(others) for name, others in data["alike"].items()}
    return Named(data["status"], tuple(data["effects"]), tuple(data["rivals"]), alike)
