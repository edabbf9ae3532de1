"""`taxel gap blind`: hidden causes, sealed, diagnosed elsewhere, opened, scored."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markdown import Markdown
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from taxel.errors import TaxelError


def blind(
    worlds: Annotated[int, typer.Option(help="Worlds on the rig of four boards.")],
    out: Annotated[Path, typer.Option(help="Folder; a check that was cut goes on.")],
    full_hand: Annotated[int, typer.Option(help="Worlds on the whole hand, besides.")] = 0,
    seed: Annotated[int | None, typer.Option(help="For tests: of the draws, instead of the system's entropy.")] = None,
    jobs: Annotated[int | None, typer.Option(help="Worlds at a time; default: one a core.")] = None,
    minutes: Annotated[float | None, typer.Option(help="Begin no world after that; score what is there.")] = None,
    page: Annotated[Path | None, typer.Option(help="Write the score sheet here too (Markdown).")] = None,
    also: Annotated[
        list[Path] | None, typer.Option(help="answers.jsonl.gz of a further run, scored with this one; several times.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the score as JSON.")] = False,
) -> None:
    """Seal worlds with hidden causes, diagnose them in another process, open the seals and score.

    Example: taxel gap blind --worlds 24 --out out/blind
    """
    # Here, for a diagnosis needs no emulator: the other commands of the group load in half the time.
    from taxel.blind.answers import answers
    from taxel.blind.records import RECORDS, read_records, require_diagnosis, together, versions, write_records
    from taxel.blind.run import opened, run_worlds, seal
    from taxel.blind.score import score
    from taxel.blind.sheet import sheet
    from taxel.blind.version import diagnosis_version

    if worlds < 1 or full_hand < 0:
        raise TaxelError("--worlds: expected 1 or more, and --full-hand 0 or more; correct the number")
    if seed is not None and seed < 0:
        raise TaxelError(f"--seed: expected 0 or more, found {seed}")
    if jobs is not None and jobs < 1:
        raise TaxelError(f"--jobs: expected 1 or more, found {jobs}")
    if minutes is not None and not minutes >= 0:
        raise TaxelError(f"--minutes: expected 0 or more, found {minutes:g}")
    others = [(str(path), read_records(path)) for path in also or ()]
    for where, more in others if minutes != 0 else ():  # before hours of work, not after
        require_diagnosis({diagnosis_version()}, more, where)
    console = Console(stderr=as_json, markup=False)
    drawn = seal(out, worlds, full_hand, seed)
    console.print(f"sealed: {out / 'commitments.json'}", highlight=False)
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as progress:
        task = progress.add_task("worlds", total=len(drawn))
        seconds = None if minutes is None else 60.0 * minutes
        run_worlds(out, drawn, jobs, lambda done, total: progress.update(task, completed=done, total=total), seconds)
    own = answers(out, opened(out))
    write_records(out / RECORDS, own)
    for where, more in others:
        own = together(own, more, where)
    found = score(own)
    (out / "score.json").write_text(json.dumps(found, indent=1, allow_nan=False))
    whole = f" --full-hand {full_hand}" if full_hand else ""
    runs = f", with {sum(len(more) for _, more in others)} worlds of --also" if others else ""
    by = " and ".join(sorted(versions(own))) or "none"
    made = f"Made by `taxel gap blind --worlds {worlds}{whole}`{runs}; {found['worlds']} worlds gave a report."
    made += f" Version of the diagnosis, by its sources: {by}."
    text = sheet(found, made)
    for path in (out / "score.md", *([page] if page else [])):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    if as_json:
        print(json.dumps(found, allow_nan=False))
    else:
        console.print(Markdown(text))
        console.print(f"score: {out / 'score.json'}", highlight=False)
