"""The index of a folder: `grasps.csv` with one line for each grasp, and `index.json` with the shards and checksums."""

import csv
import hashlib
import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np

from taxel.generate.folder import FORMAT, VERSION
from taxel.generate.recipe import Recipe
from taxel.generate.shard import format_shard_name, get_creation_time, grasp_id, read_table
from taxel.generate.versions import list_package_versions
from taxel.output import open_whole_text, write_whole

INDEX: Final = "index.json"
GRASPS: Final = "grasps.csv"
FIRST_COLUMNS: Final = ("grasp", "shard", "id", "label", "object", "approach")
"""Columns before the sampled values."""

Progress = Callable[[int, int], object]


def write_index(out: Path, recipe: Recipe, progress: Progress) -> None:
    """Write the index of a complete folder: a table of all grasps, and a JSON file with the shards and checksums.

    progress: called with the number of processed shards and the total. The tables of the shards are read one at a time.
    `index.json` is written last: a folder with this file is complete.
    """
    names = sorted(
        {name for shard in range(recipe.shards) for name in read_table(_get_shard_path(out, recipe, shard)).names}
    )
    labels: Counter[str] = Counter()
    shards: list[dict[str, Any]] = []
    with open_whole_text(out / GRASPS) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*FIRST_COLUMNS, *names])
        for shard in range(recipe.shards):
            path = _get_shard_path(out, recipe, shard)
            table = read_table(path)
            labels.update(table.label)
            columns = [table.names.index(name) if name in table.names else -1 for name in names]
            for row, number in enumerate(table.number.tolist()):
                values = [_format_number(table.values[row, column]) if column >= 0 else "" for column in columns]
                texts = (table.label[row], table.object[row], table.approach[row])
                writer.writerow([number, path.name, grasp_id(number), *texts, *values])
            first, grasps = int(table.number[0]), len(table.number)
            shards.append({"file": path.name, "first": first, "grasps": grasps, **_read_size_and_checksum(path)})
            progress(shard + 1, recipe.shards)
    content = {
        "format": FORMAT,
        "version": VERSION,
        "created": get_creation_time(),
        "versions": list_package_versions(),
        "recipe_sha256": recipe.digest,
        "recipe": recipe.to_json(),
        "labels": dict(sorted(labels.items())),
        "table": {"file": GRASPS, "columns": [*FIRST_COLUMNS, *names], **_read_size_and_checksum(out / GRASPS)},
        "shards": shards,
    }
    write_whole(out / INDEX, (json.dumps(content, indent=1) + "\n").encode())


def _get_shard_path(out: Path, recipe: Recipe, shard: int) -> Path:
    """Return the path of a shard in the folder `out`."""
    return out / format_shard_name(shard, recipe.shards)


def _format_number(value: float) -> str:
    """Format a number as the shortest string that represents the same number; empty for NaN."""
    return "" if np.isnan(value) else repr(float(value)).removesuffix(".0")


def _read_size_and_checksum(path: Path) -> dict[str, Any]:
    """Return size in bytes and SHA-256 of a file, as entries of the index."""
    with path.open("rb") as file:
        return {"bytes": path.stat().st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}
