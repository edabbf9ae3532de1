"""The folder of a recipe: what is there, what is missing, and how a file comes into it whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Final, NoReturn

from taxel.generate.errors import FolderError
from taxel.generate.recipe import Recipe
from taxel.generate.shard import created, recipe_of, shard_name
from taxel.generate.versions import versions
from taxel.hand.errors import format_path, format_value
from taxel.recording.errors import DatasetError

RECIPE: Final = "recipe.json"
FORMAT: Final = "taxel-generated"
VERSION: Final = 1

ANOTHER: Final = "choose another --out, or give the recipe that this folder was begun with"


def begin(out: Path, recipe: Recipe) -> list[int]:
    """Make the folder, or go on with it; the numbers of the shards that are missing.

    Raises FolderError for a folder of something else, of another recipe, or begun with other releases; OSError.
    """
    wanted = _statement(recipe)
    if not out.exists():
        out.mkdir(parents=True)
    if not out.is_dir():
        _fail(out, "a folder", "a file", "choose another --out")
    record = out / RECIPE
    if record.exists():
        _check_same(record, _read(record), wanted)
    else:
        _check_empty(out)
        put(record, _text(wanted))
    for part in out.glob(".*.part"):
        part.unlink(missing_ok=True)  # what a killed run was writing
    return [shard for shard in range(recipe.shards) if not _is_there(out, recipe, shard)]


def _is_there(out: Path, recipe: Recipe, shard: int) -> bool:
    path = out / shard_name(shard, recipe.shards)
    if not path.exists():
        return False
    try:
        found = recipe_of(path)
    except DatasetError:
        found = ""
    if found != recipe.digest:
        _fail(path, "a shard of this recipe", "another file", "remove that file, or choose another --out")
    return True


def put(path: Path, content: bytes) -> None:
    """Write a file so that its name stands for all of it or for nothing, even after a power cut."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with part.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    place(part, path)


def place(part: Path, path: Path) -> None:
    """Give a whole file, which is on the disk, its name."""
    part.replace(path)
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _statement(recipe: Recipe) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "created": created(),
        "versions": versions(),
        "recipe_sha256": recipe.digest,
        "recipe": recipe.to_json(),
    }


def _text(content: dict[str, Any]) -> bytes:
    return (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()


def _read(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_bytes())
    except ValueError:
        found = None
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        _fail(path, f'a record with format "{FORMAT}"', "another file", "choose another --out")
    return found


def _check_same(path: Path, found: dict[str, Any], wanted: dict[str, Any]) -> None:
    difference = first_difference(found, wanted)
    if difference is not None:
        field, there, asked = difference
        remedy = "make the rest with the releases that began it" if field.startswith("versions") else ANOTHER
        raise FolderError(format_path(path), field, f"{format_value(asked)} as asked for", format_value(there), remedy)


def first_difference(found: Any, wanted: Any, path: str = "") -> tuple[str, Any, Any] | None:
    """Where two JSON values differ first: the path, and either side there. Digests are looked at last."""
    if isinstance(found, dict) and isinstance(wanted, dict):
        keys = sorted({*found, *wanted}, key=lambda key: (key.endswith("sha256"), key))
        parts = [(f"{path}.{key}" if path else key, found.get(key), wanted.get(key)) for key in keys]
    elif isinstance(found, list) and isinstance(wanted, list) and len(found) == len(wanted):
        parts = [(f"{path}[{k}]", *pair) for k, pair in enumerate(zip(found, wanted, strict=True))]
    else:
        return None if found == wanted else (path, found, wanted)
    differences = (first_difference(there, asked, where) for where, there, asked in parts)
    return next((one for one in differences if one is not None), None)


def _check_empty(out: Path) -> None:
    others = sorted(one.name for one in out.iterdir() if not one.name.endswith(".part"))
    if others:
        _fail(
            out,
            "an empty folder, or one that taxel generate began",
            f"one with {format_value(others[0])}",
            "choose another --out",
        )


def _fail(path: Path, expected: str, found: str, remedy: str) -> NoReturn:
    raise FolderError(format_path(path), "/", expected, found, remedy)
