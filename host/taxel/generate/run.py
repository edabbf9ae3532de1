"""Generation of a whole recipe: the missing shards, then the index."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from taxel.generate.folder import open_folder
from taxel.generate.index import INDEX, write_index
from taxel.generate.recipe import Recipe
from taxel.generate.shard import format_shard_name
from taxel.generate.workers import Workers
from taxel.output import write_whole

StageProgress = Callable[[str, int, int], None]
"""Called with the name of the stage, the completed number and the total number."""


@dataclass(frozen=True)
class GenerationResult:
    """Result of a generation run.

    index: the index file. grasps: number of grasps in the folder. generated_grasps: number of grasps that this run
    generated.
    """

    index: Path
    grasps: int
    generated_grasps: int


def show_nothing(stage: str, done: int, total: int) -> None:
    """Do nothing: the default `StageProgress` callback."""


def generate(recipe: Recipe, out: Path, workers: Workers, progress: StageProgress = show_nothing) -> GenerationResult:
    """Generate all grasps of a recipe in the folder `out`, or continue an interrupted run in that folder.

    workers: processes or cluster that compute the shards. progress: called with the stage "grasps" or "index", the
    completed number and the total. The bytes of the files depend neither on interruptions nor on the distribution of
    the shards to workers. Raises TaxelError, OSError; completed shards are kept.
    """
    missing = open_folder(out, recipe)
    generated = 0
    done = recipe.grasps - sum(len(recipe.numbers_of(shard)) for shard in missing)
    if missing:
        (out / INDEX).unlink(missing_ok=True)
        progress("grasps", done, recipe.grasps)
        for shard, content in workers.generate_shards(recipe, missing):
            write_whole(out / format_shard_name(shard, recipe.shards), content)
            generated += len(recipe.numbers_of(shard))
            progress("grasps", done + generated, recipe.grasps)
    if missing or not (out / INDEX).exists():
        write_index(out, recipe, lambda shards, total: progress("index", shards, total))
    return GenerationResult(out / INDEX, recipe.grasps, generated)
