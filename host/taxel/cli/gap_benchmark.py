"""`taxel gap benchmark`: several diagnoses scored on the same worlds with hidden causes."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from taxel.cli.options import AsJson, Jobs, Seed
from taxel.cli.progress import count_bar
from taxel.errors import TaxelError
from taxel.optional import require_packages


def benchmark(
    worlds: Annotated[int, typer.Option(min=1, help="Number of worlds.")],
    out: Annotated[Path, typer.Option(help="Folder of the run. An interrupted run in the folder is continued.")],
    entry: Annotated[
        list[str] | None,
        typer.Option(
            "--entry",
            help="Diagnosis to score: diagnosis, check list, least squares, or an entry point of the group "
            "taxel.diagnoses; repeatable. Default: diagnosis.",
        ),
    ] = None,
    family: Annotated[
        list[str] | None,
        typer.Option(
            "--family",
            help="Family of worlds (docs/gap-benchmark.md); repeatable. Default: those of the project's own skin.",
        ),
    ] = None,
    reserved_forms: Annotated[
        bool,
        typer.Option(
            "--reserved-forms", help="Inject causes in functional forms that no calibration of the diagnosis has used."
        ),
    ] = False,
    seed: Seed = 1,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Score diagnoses on the same worlds with hidden causes: indentations, grasps, measured touches.

    Example: taxel gap benchmark --worlds 24 --seed 5 --out out/benchmark
    """
    require_packages("taxel gap benchmark", "all", "can", "mujoco")  # the worlds are simulated and emulated
    from taxel.blind.benchmark.run import run_benchmark
    from taxel.blind.benchmark.worlds import BASE_KINDS, FAMILIES, SENSOR_FAMILIES

    entries = entry or ["diagnosis"]
    for name in family or ():
        if name not in {**FAMILIES, **SENSOR_FAMILIES}:
            known = ", ".join([*FAMILIES, *SENSOR_FAMILIES])
            raise TaxelError(f"--family: expected one of {known}, found '{name}'")
    if reserved_forms and not set(family or FAMILIES) & set(BASE_KINDS):
        known = ", ".join(BASE_KINDS)
        raise TaxelError(f"--reserved-forms: expected a family with injected causes ({known}), found none; add one")
    console = Console(stderr=as_json, markup=False)
    with count_bar(console, "benchmark", "worlds") as show:
        score = run_benchmark(out, worlds, seed, entries, family or tuple(FAMILIES), jobs, show, reserved_forms)
    if as_json:
        print(json.dumps(score))
        return
    for group in next(iter(score.values())):
        table = Table(title=f"worlds: {group}")
        table.add_column("measure")
        for name in entries:
            table.add_column(name, justify="right")
        for measure in score[entries[0]][group]:
            table.add_row(measure, *(_format_measure(score[name][group][measure]) for name in entries))
        console.print(table)
    console.print(f"score: {out / 'score.json'}", highlight=False)


def _format_measure(value: float | int | None) -> str:
    """Format a value of the score table; "-" for None, the value of a measure to which no world contributes."""
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.3f}"
