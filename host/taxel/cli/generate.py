"""`taxel generate`: synthetic grasps at scale."""

from __future__ import annotations

import json
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from taxel.cli.stages import stage_bars
from taxel.errors import TaxelError
from taxel.generate.cluster import Cluster
from taxel.generate.recipe import FIDELITIES, Recipe
from taxel.generate.recipe_file import MOST_GRASPS, MOST_PER_SHARD, UNITS, checked, read_recipe, with_mesh, with_report
from taxel.generate.run import generate as generate_all
from taxel.generate.workers import Processes, Workers


def generate(
    out: Annotated[Path, typer.Option(help="Folder of the shards; one that was cut is continued.")],
    recipe: Annotated[Path | None, typer.Option(help="What is drawn from which ranges (TOML).")] = None,
    grasps: Annotated[int, typer.Option(help="How many; 0: as the recipe says, else 1000.")] = 0,
    seed: Annotated[int, typer.Option(help="Decides every draw; -1: as the recipe says, else 1.")] = -1,
    effects: Annotated[
        Path | None, typer.Option(help="report.json of taxel gap diagnose: its effects, drawn within their intervals.")
    ] = None,
    mesh: Annotated[
        list[Path] | None, typer.Option(help="Another object: convex hull of an STL, OBJ or PLY file; may be repeated.")
    ] = None,
    unit: Annotated[str, typer.Option(help=f"Of --mesh: {', '.join(UNITS)}.")] = "m",
    fidelity: Annotated[
        str, typer.Option(help=f"{', '.join(FIDELITIES)}; empty: as the recipe says, else quick.")
    ] = "",
    shard: Annotated[int, typer.Option(help="Grasps of one file; 0: as the recipe says, else 200.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes of this machine; 0: one a core.")] = 0,
    scheduler: Annotated[str, typer.Option(help="Dask scheduler of a cluster instead, as tcp://host:8786.")] = "",
    as_json: Annotated[bool, typer.Option("--json", help="Print what was made as JSON.")] = False,
) -> None:
    """Simulate grasps with drawn objects, poses, forces and effects, and write them as shards with an index.

    Run the same command again to go on with a run that was cut: the result is the same to the byte.

    Example: taxel generate --grasps 100000 --effects out/gap/report.json --out out/synthetic
    """
    wanted = _recipe(recipe, grasps, seed, shard, fidelity)
    if unit not in UNITS:
        raise TaxelError(f"--unit: expected {', '.join(UNITS)}, found '{unit}'")
    for path in mesh or ():
        wanted = with_mesh(wanted, path, unit)
    if effects is not None:
        wanted = with_report(wanted, effects)
    checked(wanted, "recipe" if recipe is None else str(recipe))
    began = time.monotonic()
    with stage_bars(hidden=as_json) as show:
        done = generate_all(wanted, out, _workers(workers, scheduler), show)
    _say(out, wanted, done.made, time.monotonic() - began, as_json)


def _recipe(path: Path | None, grasps: int, seed: int, shard: int, fidelity: str) -> Recipe:
    recipe = Recipe() if path is None else read_recipe(path)
    for option, value, least, most in (("grasps", grasps, 0, MOST_GRASPS), ("shard", shard, 0, MOST_PER_SHARD)):
        if not least <= value <= most:
            raise TaxelError(f"--{option}: expected {least} to {most}, found {value}")
    if seed < -1:
        raise TaxelError(f"--seed: expected 0 or more (-1: as the recipe says), found {seed}")
    if fidelity and fidelity not in FIDELITIES:
        raise TaxelError(f"--fidelity: expected {', '.join(FIDELITIES)}, found '{fidelity}'")
    return replace(
        recipe,
        grasps=grasps or recipe.grasps,
        seed=recipe.seed if seed < 0 else seed,
        shard=shard or recipe.shard,
        fidelity=fidelity or recipe.fidelity,
    )


def _workers(count: int, scheduler: str) -> Workers:
    if count < 0:
        raise TaxelError(f"--workers: expected 0 (one a core) or more, found {count}")
    if scheduler and count:
        raise TaxelError(
            "--workers: expected none beside --scheduler, whose cluster has its own; leave one of them out"
        )
    return Cluster(scheduler) if scheduler else Processes(count or os.cpu_count() or 1)


def _say(out: Path, recipe: Recipe, made: int, seconds: float, as_json: bool) -> None:
    told: dict[str, Any] = {
        "folder": str(out),
        "grasps": recipe.grasps,
        "shards": recipe.shards,
        "made": made,
        "seconds": round(seconds, 3),
        "effects": [one.name for one in recipe.effects],
        "recipe_sha256": recipe.digest,
    }
    if as_json:
        print(json.dumps(told))
        return
    names = ", ".join(one.name.replace("_", " ") for one in recipe.effects) or "none"
    print(f"{out}: {recipe.grasps} grasps in {recipe.shards} shards, effects: {names}")
    print(
        f"made now: {made} in {seconds:.1f} s, {made / max(seconds, 1e-9):.2f} a second"
        if made
        else "nothing was missing"
    )
