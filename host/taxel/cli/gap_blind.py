"""`taxel gap blind`: sealed causes, diagnosed in a separate process, opened and scored."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markdown import Markdown
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from taxel.cli.options import AsJson, Jobs
from taxel.optional import require_packages
from taxel.output import write_whole


def blind(
    worlds: Annotated[int, typer.Option(min=1, help="Number of worlds with the rig of four boards.")],
    out: Annotated[Path, typer.Option(help="Folder of the check. An interrupted check in the folder is continued.")],
    full_hand_worlds: Annotated[int, typer.Option(min=0, help="Number of further worlds with the whole hand.")] = 0,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the worlds, for tests. Default: random.")] = None,
    jobs: Jobs = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.0, help="Start no world after this time, and score the finished worlds.")
    ] = None,
    page: Annotated[Path | None, typer.Option(help="Also write the score sheet to this Markdown file.")] = None,
    add_answers: Annotated[
        list[Path] | None, typer.Option(help="answers.jsonl.gz of another run, scored with this run; repeatable.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check the diagnosis on worlds with sealed causes, and score the answers.

    A world is an emulated skin with randomly chosen causes of a gap. The causes are sealed by a hash; a separate
    process diagnoses the datasets of the world without access to the causes; then the seal is opened.

    Example: taxel gap blind --worlds 24 --out out/blind
    """
    require_packages("taxel gap blind", "all", "can", "mujoco")  # the worlds are simulated and emulated
    # Imported here because the other commands of the group need no emulator and start in half the time.
    from taxel.blind.records import (
        RECORDS,
        list_diagnosis_versions,
        merge_results,
        read_records,
        require_version,
        write_records,
    )
    from taxel.blind.results import read_results
    from taxel.blind.run import run_worlds
    from taxel.blind.run_folder import open_sealed_worlds, seal_worlds
    from taxel.blind.score import score
    from taxel.blind.score_sheet import Provenance, score_sheet
    from taxel.blind.version import compute_diagnosis_version

    further_runs = [(str(path), read_records(path)) for path in add_answers or ()]
    for source, further in further_runs if minutes != 0 else ():  # before hours of work; 0 minutes: no work
        require_version({compute_diagnosis_version()}, further, source)
    console = Console(stderr=as_json, markup=False)
    sealed = seal_worlds(out, worlds, full_hand_worlds, seed)
    console.print(f"sealed: {out / 'commitments.json'}", highlight=False)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("worlds", total=len(sealed))
        seconds = None if minutes is None else 60.0 * minutes
        run_worlds(out, sealed, jobs, lambda done, total: progress.update(task, completed=done, total=total), seconds)
    results = read_results(out, open_sealed_worlds(out))
    write_records(out / RECORDS, results)
    for source, further in further_runs:
        results = merge_results(results, further, source)
    figures = score(results)
    write_whole(out / "score.json", json.dumps(figures, indent=1, allow_nan=False))
    added = sum(len(further) for _, further in further_runs)
    versions = sorted(list_diagnosis_versions(results))
    text = score_sheet(figures, Provenance(worlds, full_hand_worlds, added, figures["worlds"], versions).text())
    for path in (out / "score.md", *([page] if page else [])):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)
    if as_json:
        print(json.dumps(figures, allow_nan=False))
    else:
        console.print(Markdown(text))
        console.print(f"score: {out / 'score.json'}", highlight=False)
