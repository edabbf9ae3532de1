"""The folder of a recipe: its existing and missing shards, and atomic writing of files."""

import json
from pathlib import Path
from typing import Any, Final, NoReturn

from taxel.generate.errors import FolderError
from taxel.generate.recipe import Recipe
from taxel.generate.shard import format_shard_name, get_creation_time, read_recipe_digest
from taxel.generate.versions import list_package_versions
from taxel.hand.errors import format_path, format_value
from taxel.input_files import parse_json, read_regular_file
from taxel.input_files.json_text import JSON_BYTES_MAX
from taxel.output import write_whole
from taxel.recording.errors import DatasetError

RECIPE: Final = "recipe.json"
FORMAT: Final = "taxel-generated"
VERSION: Final = 1

OTHER_RECIPE: Final = "choose another --out, or give the recipe with which this folder was started"


def open_folder(out: Path, recipe: Recipe) -> list[int]:
    """Create the folder of generated shards, or check an existing one; return the numbers of the missing shards.

    A new folder gets a record of the recipe and the package releases; incomplete files of a killed run are deleted.
    Raises FolderError for a folder with other content, with another recipe, or started with other releases; OSError.
    """
    expected = _make_record(recipe)
    if not out.exists():
        out.mkdir(parents=True)
    if not out.is_dir():
        _fail(out, "a folder", "a file", "choose another --out")
    record = out / RECIPE
    if record.exists():
        _check_same_recipe(record, _read_record(record), expected)
    else:
        _check_empty(out)
        write_whole(record, _format_record(expected))
    for part in out.glob(".*.part"):
        part.unlink(missing_ok=True)  # incomplete files of a killed run
    return [shard for shard in range(recipe.shards) if not _has_shard(out, recipe, shard)]


def _has_shard(out: Path, recipe: Recipe, shard: int) -> bool:
    """Return whether the folder contains a shard of the recipe. Raises FolderError for another file of this name."""
    path = out / format_shard_name(shard, recipe.shards)
    if not path.exists():
        return False
    try:
        digest = read_recipe_digest(path)
    except DatasetError:
        digest = ""
    if digest != recipe.digest:
        _fail(path, "a shard of this recipe", "another file", "remove that file, or choose another --out")
    return True


def _make_record(recipe: Recipe) -> dict[str, Any]:
    """Make the record of a generation run, a JSON file: recipe, versions and creation time."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "created": get_creation_time(),
        "versions": list_package_versions(),
        "recipe_sha256": recipe.digest,
        "recipe": recipe.to_json(),
    }


def _format_record(content: dict[str, Any]) -> bytes:
    """Format a record as the bytes of a JSON file with sorted keys."""
    return (json.dumps(content, indent=1, sort_keys=True) + "\n").encode()


def _read_record(path: Path) -> dict[str, Any]:
    """Read the record of the generation run in a folder. Raises FolderError for another file."""
    try:
        content = parse_json(read_regular_file(path, JSON_BYTES_MAX))
    except ValueError:
        content = None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        _fail(path, f'a record with format "{FORMAT}"', "another file", "choose another --out")
    return content


def _check_same_recipe(path: Path, content: dict[str, Any], expected: dict[str, Any]) -> None:
    """Raise FolderError if the record in the folder has another recipe or other releases than the requested run.

    path: file of the record. content: record in the folder. expected: record of the requested run.
    """
    difference = find_first_difference(content, expected)
    if difference is not None:
        field, in_folder, requested = difference
        is_release = field.startswith("versions")
        remedy = "generate the missing shards with the same releases" if is_release else OTHER_RECIPE
        expected_text = f"{format_value(requested)} as requested"
        raise FolderError(format_path(path), field, expected_text, format_value(in_folder), remedy)


def find_first_difference(a: Any, b: Any, path: str = "") -> tuple[str, Any, Any] | None:
    """Find the first difference between two JSON values: its path and both values; None for equal values.

    Digests (keys that end with "sha256") are compared last, because they differ with every other difference. path:
    path of `a` and `b` in their documents.
    """
    if isinstance(a, dict) and isinstance(b, dict):
        keys = sorted({*a, *b}, key=lambda key: (key.endswith("sha256"), key))
        parts = [(f"{path}.{key}" if path else key, a.get(key), b.get(key)) for key in keys]
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        parts = [(f"{path}[{k}]", *pair) for k, pair in enumerate(zip(a, b, strict=True))]
    else:
        return None if a == b else (path, a, b)
    differences = (find_first_difference(value_a, value_b, part) for part, value_a, value_b in parts)
    return next((difference for difference in differences if difference is not None), None)


def _check_empty(out: Path) -> None:
    """Raise FolderError if a folder contains anything except unfinished files."""
    names = sorted(path.name for path in out.iterdir() if not path.name.endswith(".part"))
    if names:
        _fail(
            out,
            "an empty folder, or one of taxel generate",
            f"one with {format_value(names[0])}",
            "choose another --out",
        )


def _fail(path: Path, expected: str, found: str, remedy: str) -> NoReturn:
    """Raise FolderError for a file or folder of a generation run, with its expected and found content."""
    raise FolderError(format_path(path), "/", expected, found, remedy)
