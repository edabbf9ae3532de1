"""`taxel gap next`: the contacts to record next."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from threadpoolctl import threadpool_limits

from taxel.cli.options import AsJson
from taxel.cli.progress import stage_bars
from taxel.errors import TaxelError
from taxel.gap.comparison.compare import ProgressCallback
from taxel.gap.experiment_design.from_report import diagnose_findings, read_findings
from taxel.gap.experiment_design.ranking import MAX_CONTACTS, ContactRanking, rank_next_contacts
from taxel.gap.experiment_design.unrecorded_approaches import read_unrecorded
from taxel.gap.fitting.state import State


def rank_contacts(
    real: Annotated[
        Path, typer.Argument(help="Grasp dataset of the hand, or a report.json.", metavar="REAL.h5|REPORT")
    ],
    sim: Annotated[
        Path | None, typer.Argument(help="Grasp dataset of the simulator; omitted with a report.", metavar="SIM.h5")
    ] = None,
    candidates: Annotated[
        list[Path] | None,
        typer.Option("--candidate", help="Simulated dataset of approaches that could be recorded; repeatable."),
    ] = None,
    top: Annotated[int, typer.Option(min=1, help="Number of contacts to list.")] = MAX_CONTACTS,
    as_json: AsJson = False,
) -> None:
    """Rank the contacts that would separate confounded effects or narrow the intervals of their parameters.

    Example: taxel gap next out/gap/report.json --candidate out/more/sim.h5
    """
    if sim is None and real.suffix in (".h5", ".hdf5"):
        raise TaxelError(
            f"SIM.h5: expected the simulated dataset after {real}, found nothing; give both datasets or a report.json"
        )
    with stage_bars(hidden=as_json) as show, threadpool_limits(limits=1):
        findings = read_findings(real, show) if sim is None else diagnose_findings(real, sim, show)
        further, notes = _read_further_states(findings.fit_data.state, candidates or [], show)
        show("ranking", 0, 1)
        ranking = rank_next_contacts(findings, further, top)
        show("ranking", 1, 1)
    if as_json:
        result = {"line": ranking.criterion, "next_presses": ranking.to_json(), "notes": notes}
        print(json.dumps(result, allow_nan=False))
    else:
        _print_contacts(ranking, notes)


def _read_further_states(
    state: State, candidates: Sequence[Path], show: ProgressCallback
) -> tuple[list[State], list[str]]:
    """Read simulated approaches that were not recorded with the hand.

    state: data of the diagnosed pair of datasets. candidates: further simulated datasets. Returns (data of the
    approaches that could be recorded, for each dataset with such approaches; a note for each dataset without).
    """
    paths = [Path(state.pair.paths[1])] if state.pair.unrecorded_conditions else []
    further: list[State] = []
    notes = []
    for path in [*paths, *candidates]:
        conditions = [condition for other in further for condition in other.pair.conditions]
        new = read_unrecorded(state, path, conditions, lambda done, total: show("reading candidates", done, total))
        if new is None:
            notes.append(f"{path}: all approaches of this dataset are recorded already")
        else:
            further.append(new)
    return further, notes


def _print_contacts(ranking: ContactRanking, notes: Sequence[str]) -> None:
    """Print the recommended contacts in order, each with its information gain in bits and the reason."""
    print(ranking.criterion)
    for rank, candidate in enumerate(ranking.contacts, 1):
        print(f"{rank:3}. {candidate.contact.description}: {candidate.gain:.2f} bits")
        print(f"     {candidate.reason}")
    for note in notes:
        print(f"note: {note}")
