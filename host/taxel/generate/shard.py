"""One shard: an ordinary grasp dataset, with a table of what was drawn for each of its grasps."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.setup import Setup
from taxel.generate.grasping import ShardMaker
from taxel.generate.one_thread import one_thread
from taxel.generate.recipe import HAND, Recipe
from taxel.hand import load_hand
from taxel.recording.grasp_checks import Place
from taxel.recording.grasp_format import SIM
from taxel.recording.grasp_hdf5 import open_hdf5
from taxel.recording.grasp_storage import LIBVER, create_group, write_array, write_attributes, writing_errors
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter

GROUP: Final = "generated"
"""Of the table in a shard; readers of grasp datasets pass it by."""

TEXTS: Final = ("label", "object", "approach")

BEGINNING: Final = "1970-01-01T00:00:00+00:00"
"""When a shard says that it was created: the same recipe is the same bytes."""


@dataclass(frozen=True, eq=False)
class ShardTable:
    """A row for each grasp of a shard: number i64[g]; label, object, approach str[g]; values f64[g, p] of `names`, NaN
    where it has none.
    """

    number: NDArray[np.int64]
    label: tuple[str, ...]
    object: tuple[str, ...]
    approach: tuple[str, ...]
    names: tuple[str, ...]
    values: NDArray[np.float64]


def shard_name(shard: int, shards: int) -> str:
    """The file of a shard; names sort as their numbers."""
    return f"shard-{shard:0{max(5, len(str(shards - 1)))}d}.h5"


def grasp_id(number: int) -> str:
    """What a grasp is called in its shard."""
    return f"g{number:09d}"


def make_shard(recipe: Recipe, shard: int) -> bytes:
    """A whole shard, as the bytes of its file. The same recipe and number give the same bytes, whoever makes it."""
    with one_thread(), tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        path = Path(folder) / shard_name(shard, recipe.shards)
        _write(recipe, shard, path)
        return path.read_bytes()


@lru_cache(maxsize=1)
def _setup() -> Setup:
    return Setup(load_hand(HAND))


def _write(recipe: Recipe, shard: int, path: Path) -> None:
    maker = ShardMaker(recipe, shard, _setup())
    rows: list[tuple[str, str, str, dict[str, float]]] = []
    header = DatasetHeader(
        source=SIM,
        hand=maker.setup.hand.name,
        taxels=maker.taxels,
        sensors=maker.sensors,
        objects={},
        generator=f"taxel {version('taxel')}; generated, recipe {recipe.digest[:12]}",
        sensor_model=maker.sensor_model,
        created=created(),
    )
    known: set[str] = set()
    with GraspDatasetWriter.create(path, header) as out:
        for number in recipe.numbers_of(shard):
            made = maker.make(number)
            if made.record.object not in known:
                known.add(made.record.object)
                out.add_object(made.record.object, made.mesh)
            out.add(made.record, grasp_id(number))
            rows.append((made.label, made.record.object, made.record.approach, made.values))
    _add_table(path, recipe, shard, rows)


def created() -> str:
    """`SOURCE_DATE_EPOCH` if it is set, else the beginning of 1970."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(epoch), UTC).isoformat() if epoch.isdecimal() else BEGINNING


def _add_table(path: Path, recipe: Recipe, shard: int, rows: list[tuple[str, str, str, dict[str, float]]]) -> None:
    *texts, drawn = zip(*rows, strict=True)
    names = tuple(sorted({name for values in drawn for name in values}))
    table = np.array([[values.get(name, np.nan) for name in names] for values in drawn])
    with writing_errors(Place(str(path))), open_hdf5(path, "r+", LIBVER) as file:
        group = create_group(file, GROUP)
        write_attributes(group, {"recipe_sha256": recipe.digest, "seed": recipe.seed, "shard": shard})
        write_array(group, "number", np.array(recipe.numbers_of(shard), np.int64))
        for name, column in zip(TEXTS, texts, strict=True):
            write_array(group, name, tuple(column))
        write_array(group, "names", names)
        write_array(group, "values", table)


def read_table(path: Path) -> ShardTable:
    """The table of a shard. Raises DatasetError for a file that has none."""
    place = Place(str(path)).key(GROUP)
    with open_hdf5(path, "r") as file:
        try:
            group = file[GROUP]
            texts = {name: tuple(group[name].asstr()[()].tolist()) for name in (*TEXTS, "names")}
            return ShardTable(group["number"][()], values=group["values"][()], **texts)
        except (KeyError, TypeError, AttributeError, OSError):
            place.fail("the table of a generated shard", "none", "make the shard again with taxel generate")


def recipe_of(path: Path) -> str:
    """SHA-256 of the recipe that a shard was made from; "" for a file that says none."""
    with open_hdf5(path, "r") as file:
        return str(file[GROUP].attrs["recipe_sha256"]) if GROUP in file else ""
