"""`taxel gap next`: the presses that would tell most of what a diagnosis leaves open."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from threadpoolctl import threadpool_limits

from taxel.cli.stages import stage_bars
from taxel.errors import TaxelError
from taxel.gap.diagnosis import Show
from taxel.gap.presses.from_report import findings_in, findings_of_pair
from taxel.gap.presses.ranking import MOST_PRESSES, NextPresses, next_presses
from taxel.gap.presses.unrecorded import unrecorded
from taxel.gap.state import State


def next_press(
    real: Annotated[
        Path, typer.Argument(help="Grasp dataset of the hand, or a report.json.", metavar="REAL.h5|REPORT")
    ],
    sim: Annotated[
        Path | None, typer.Argument(help="Grasp dataset of the simulator; not with a report.", metavar="SIM.h5")
    ] = None,
    candidates: Annotated[
        list[Path] | None,
        typer.Option(help="A further simulation, of approaches that could be recorded; may be repeated."),
    ] = None,
    top: Annotated[int, typer.Option(help="How many presses are listed.")] = MOST_PRESSES,
    as_json: Annotated[bool, typer.Option("--json", help="Print them as JSON.")] = False,
) -> None:
    """Rank the presses that would tell confounded effects apart, or narrow what is known of the found ones.

    Example: taxel gap next out/gap/report.json --candidates out/more/sim.h5
    """
    if top < 1:
        raise TaxelError(f"--top: expected 1 or more, found {top}")
    if sim is None and real.suffix in (".h5", ".hdf5"):
        raise TaxelError(f"SIM.h5: expected the simulation beside {real}, found none; give both, or a report.json")
    with stage_bars(hidden=as_json) as show, threadpool_limits(limits=1):
        findings = findings_in(real, show) if sim is None else findings_of_pair(real, sim, show)
        more, notes = _more(findings.judge.state, candidates or [], show)
        show("ranking", 0, 1)
        found = next_presses(findings, more, top)
        show("ranking", 1, 1)
    if as_json:
        print(json.dumps({"line": found.line, "next_presses": found.to_json(), "notes": notes}, allow_nan=False))
    else:
        _say(found, notes)


def _more(state: State, candidates: Sequence[Path], show: Show) -> tuple[list[State], list[str]]:
    """What was simulated and not recorded: in the pair's own simulation, and in further ones."""
    paths = [Path(state.pair.paths[1])] if state.pair.unrecorded else []
    more: list[State] = []
    notes = []
    for path in [*paths, *candidates]:
        known = [cell for one in more for cell in one.pair.cells]
        found = unrecorded(state, path, known, lambda done, total: show("reading candidates", done, total))
        if found is None:
            notes.append(f"{path}: no approach that is not known already")
        else:
            more.append(found)
    return more, notes


def _say(found: NextPresses, notes: Sequence[str]) -> None:
    print(found.line)
    for place, one in enumerate(found.presses, 1):
        print(f"{place:3}. {one.press.words}: {one.gain:.2f} bits")
        print(f"     {one.why}")
    for note in notes:
        print(f"note: {note}")
