"""One shard: a grasp dataset with a table of the sampled values of each grasp."""

import os
import tempfile
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Final

import numpy as np

from taxel.campaign.setup import Setup
from taxel.generate.grasping import ShardGenerator
from taxel.generate.recipe import Recipe
from taxel.generate.single_thread import single_thread
from taxel.hand import load_hand
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_format import SIM
from taxel.recording.grasp_hdf5 import open_hdf5
from taxel.recording.grasp_storage import convert_writing_errors, create_group, write_array, write_attributes
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter
from taxel.recording.hdf5_output import change_hdf5
from taxel.types import FloatArray, IntArray

GROUP: Final = "generated"
"""Name of the table's group in a shard; readers of grasp datasets ignore it."""

TEXTS: Final = ("label", "object", "approach")

EPOCH: Final = "1970-01-01T00:00:00+00:00"
"""Creation time in a shard. It is fixed, so that the same recipe gives the same bytes."""


@dataclass(frozen=True, eq=False)
class ShardTable:
    """Table of the sampled values of a shard with g grasps.

    number: i64[g], numbers of the grasps in the recipe. label: kind of object of each grasp. object, approach: names of
    object and approach of each grasp. names: names of p sampled values. values: f64[g, p], these values, NaN where a
    grasp has no such value.
    """

    number: IntArray
    label: tuple[str, ...]
    object: tuple[str, ...]
    approach: tuple[str, ...]
    names: tuple[str, ...]
    values: FloatArray


def format_shard_name(shard: int, shards: int) -> str:
    """Format the file name of a shard; sorted by name, the files are in the order of their numbers.

    shards: number of all shards.
    """
    return f"shard-{shard:0{max(5, len(str(shards - 1)))}d}.h5"


def grasp_id(number: int) -> str:
    """Return the id of grasp `number` in its shard, such as "g000000042"."""
    return f"g{number:09d}"


def generate_shard(recipe: Recipe, shard: int) -> bytes:
    """Generate the grasps of a shard and return the content of its file.

    The content depends only on the recipe, the number of the shard and the releases of the packages.
    """
    with single_thread(), tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        path = Path(folder) / format_shard_name(shard, recipe.shards)
        _write_shard(recipe, shard, path)
        return path.read_bytes()


@lru_cache(maxsize=1)
def _load_setup(hand: str) -> Setup:
    """Load the setup of a campaign with a packaged hand; the latest result is cached."""
    return Setup(load_hand(hand))


def _write_shard(recipe: Recipe, shard: int, path: Path) -> None:
    """Generate the grasps of a shard and write them to the file `path`; an error may leave the file unfinished."""
    generator = ShardGenerator(recipe, shard, _load_setup(recipe.hand))
    rows: list[tuple[str, str, str, dict[str, float]]] = []
    header = DatasetHeader(
        source=SIM,
        hand=generator.setup.hand.name,
        taxels=generator.taxels,
        sensors=generator.sensors,
        objects={},
        generator=f"taxel {version('taxel')}; generated, recipe {recipe.digest[:12]}",
        sensor_model=generator.sensor_model,
        created=get_creation_time(),
    )
    object_names: set[str] = set()
    with GraspDatasetWriter.create_part(path, header) as out:
        for number in recipe.numbers_of(shard):
            grasp = generator.generate(number)
            if grasp.record.object not in object_names:
                object_names.add(grasp.record.object)
                out.add_object(grasp.record.object, grasp.mesh)
            out.add(grasp.record, grasp_id(number))
            rows.append((grasp.label, grasp.record.object, grasp.record.approach, grasp.values))
    _add_sample_table(path, recipe, shard, rows)


def get_creation_time() -> str:
    """Return the creation time that shards state, in ISO format.

    The time is that of the environment variable `SOURCE_DATE_EPOCH` (seconds since 1970), or else the start of 1970:
    the bytes of a shard must not depend on the time of the run.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(epoch), UTC).isoformat() if epoch.isdecimal() else EPOCH


def _add_sample_table(
    path: Path, recipe: Recipe, shard: int, rows: list[tuple[str, str, str, dict[str, float]]]
) -> None:
    """Add the table of sampled values to the file of a shard.

    rows: for each grasp its label, the names of object and approach, and its sampled values by name.
    """
    *texts, sampled = zip(*rows, strict=True)
    names = tuple(sorted({name for values in sampled for name in values}))
    table = np.array([[values.get(name, np.nan) for name in names] for values in sampled])
    with convert_writing_errors(Location(str(path))), change_hdf5(path) as file:
        group = create_group(file, GROUP)
        write_attributes(group, {"recipe_sha256": recipe.digest, "seed": recipe.seed, "shard": shard})
        write_array(group, "number", np.array(recipe.numbers_of(shard), np.int64))
        for name, column in zip(TEXTS, texts, strict=True):
            write_array(group, name, tuple(column))
        write_array(group, "names", names)
        write_array(group, "values", table)


def read_table(path: Path) -> ShardTable:
    """Read the table of sampled values of a shard. Raises DatasetError for a file without a table."""
    location = Location(str(path)).key(GROUP)
    with open_hdf5(path, "r") as file:
        try:
            group = file[GROUP]
            texts = {name: tuple(group[name].asstr()[()].tolist()) for name in (*TEXTS, "names")}
            return ShardTable(group["number"][()], values=group["values"][()], **texts)
        except (KeyError, TypeError, AttributeError, OSError):
            location.fail("the table of a generated shard", "none", "generate the shard again with taxel generate")


def read_recipe_digest(path: Path) -> str:
    """Read the SHA-256 of the recipe of a shard; an empty string for a file that is not a generated shard."""
    with open_hdf5(path, "r") as file:
        return str(file[GROUP].attrs["recipe_sha256"]) if GROUP in file else ""
