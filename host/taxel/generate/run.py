"""A whole recipe: the shards that are missing, then the index."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from taxel.generate.folder import begin, put
from taxel.generate.index import INDEX, write_index
from taxel.generate.recipe import Recipe
from taxel.generate.shard import shard_name
from taxel.generate.workers import Workers

Show = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Generated:
    """What a run did. grasps: of the folder. made: of those, in this run. index: the file that lists them."""

    index: Path
    grasps: int
    made: int


def quiet(stage: str, done: int, total: int) -> None:
    """Say nothing."""


def generate(recipe: Recipe, out: Path, workers: Workers, show: Show = quiet) -> Generated:
    """Make every grasp of a recipe in the folder `out`; go on where an earlier run was cut.

    The bytes are the same however often it was cut and whoever made which shard. show: told the stage, grasps done, and
    of how many. Raises TaxelError of one line, OSError; finished shards are kept.
    """
    missing = begin(out, recipe)
    made = 0
    done = recipe.grasps - sum(len(recipe.numbers_of(shard)) for shard in missing)
    if missing:
        (out / INDEX).unlink(missing_ok=True)
        show("grasps", done, recipe.grasps)
        for shard, content in workers.made(recipe, missing):
            put(out / shard_name(shard, recipe.shards), content)
            made += len(recipe.numbers_of(shard))
            show("grasps", done + made, recipe.grasps)
    if missing or not (out / INDEX).exists():
        write_index(out, recipe, lambda shards, total: show("index", shards, total))
    return Generated(out / INDEX, recipe.grasps, made)
