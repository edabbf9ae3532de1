"""`taxel generate`."""

import json
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from taxel.cli.options import AsJson, Jobs
from taxel.cli.progress import stage_bars
from taxel.errors import TaxelError
from taxel.generate.cluster import Cluster
from taxel.generate.recipe import FIDELITIES, Recipe
from taxel.generate.recipe_file import (
    MAX_GRASPS,
    MAX_GRASPS_PER_SHARD,
    UNITS,
    add_mesh,
    add_report,
    check_recipe,
    read_recipe,
)
from taxel.generate.run import generate as generate_all
from taxel.generate.workers import Processes, Workers


def generate(
    out: Annotated[Path, typer.Option(help="Folder of the shards. An interrupted run in the folder is continued.")],
    recipe: Annotated[
        Path | None, typer.Option(help="TOML file: which quantities are sampled from which ranges.")
    ] = None,
    grasps: Annotated[
        int | None, typer.Option(min=1, max=MAX_GRASPS, help="Number of grasps. Default: the recipe's, else 1000.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the samples. Default: the recipe's, else 1.")] = None,
    gap_report: Annotated[
        Path | None,
        typer.Option(help="report.json of taxel gap diagnose; its effects are sampled within their intervals."),
    ] = None,
    mesh: Annotated[
        list[Path] | None, typer.Option(help="STL, OBJ or PLY file; its convex hull is a further object. Repeatable.")
    ] = None,
    unit: Annotated[str, typer.Option(help=f"Unit of --mesh: {', '.join(UNITS)}.")] = "m",
    fidelity: Annotated[
        str | None, typer.Option(help=f"{' or '.join(FIDELITIES)}. Default: the recipe's, else quick.")
    ] = None,
    grasps_per_shard: Annotated[
        int | None,
        typer.Option(min=1, max=MAX_GRASPS_PER_SHARD, help="Grasps in one file. Default: the recipe's, else 200."),
    ] = None,
    jobs: Jobs = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Dask scheduler of a cluster, such as tcp://host:8786, instead of --jobs.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Generate synthetic grasps at scale.

    Objects, poses, forces and effects are sampled from a recipe; the grasps are written as shards with an index. Run
    the same command again to continue an interrupted run: the result is equal to the byte.

    Example: taxel generate --grasps 100000 --gap-report out/gap/report.json --out out/synthetic
    """
    plan = _make_recipe(recipe, grasps, seed, grasps_per_shard, fidelity)
    if unit not in UNITS:
        raise TaxelError(f"--unit: expected {', '.join(UNITS)}, found '{unit}'")
    for path in mesh or ():
        plan = add_mesh(plan, path, unit)
    if gap_report is not None:
        plan = add_report(plan, gap_report)
    check_recipe(plan, "recipe" if recipe is None else str(recipe))
    start_s = time.monotonic()
    with stage_bars(hidden=as_json) as show:
        run = generate_all(plan, out, _make_workers(jobs, scheduler), show)
    _print_run(out, plan, run.generated_grasps, time.monotonic() - start_s, as_json)


def _make_recipe(
    path: Path | None, grasps: int | None, seed: int | None, grasps_per_shard: int | None, fidelity: str | None
) -> Recipe:
    """Read the recipe of a file, or take the default recipe, and replace the values whose options were given.

    Raises `TaxelError` for an unknown fidelity.
    """
    if fidelity is not None and fidelity not in FIDELITIES:
        raise TaxelError(f"--fidelity: expected {', '.join(FIDELITIES)}, found '{fidelity}'")
    options = {"grasps": grasps, "seed": seed, "grasps_per_shard": grasps_per_shard, "fidelity": fidelity}
    given_values = {name: value for name, value in options.items() if value is not None}
    return replace(Recipe() if path is None else read_recipe(path), **given_values)  # type: ignore[arg-type]


def _make_workers(jobs: int | None, scheduler: str | None) -> Workers:
    """Make the local processes or the cluster connection that generate the shards.

    jobs: number of processes. scheduler: address of a cluster. Raises `TaxelError` if both options are given.
    """
    if scheduler is not None and jobs is not None:
        raise TaxelError("--jobs and --scheduler: expected one of them, since the cluster has its own workers")
    return Cluster(scheduler) if scheduler is not None else Processes(jobs or os.cpu_count() or 1)


def _print_run(out: Path, recipe: Recipe, new_grasps: int, seconds: float, as_json: bool) -> None:
    """Print the folder, its numbers of grasps and shards, and the rate of this run.

    new_grasps: number of grasps that this run generated; the others existed already. seconds: duration of the run.
    """
    if as_json:
        result: dict[str, Any] = {
            "folder": str(out),
            "grasps": recipe.grasps,
            "shards": recipe.shards,
            "made": new_grasps,
            "seconds": round(seconds, 3),
            "effects": [effect.name for effect in recipe.effects],
            "recipe_sha256": recipe.digest,
        }
        print(json.dumps(result))
        return
    names = ", ".join(effect.name.replace("_", " ") for effect in recipe.effects) or "none"
    print(f"{out}: {recipe.grasps} grasps in {recipe.shards} shards, effects: {names}")
    if new_grasps:
        print(
            f"generated in this run: {new_grasps} in {seconds:.1f} s, {new_grasps / max(seconds, 1e-9):.2f} per second"
        )
    else:
        print("all shards existed already")
