"""`taxel cloud match`: which shape a cloud is of."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from taxel.cli.cloud_inputs import Anywhere, AsJson, Unit, check_scale, metres, only_points
from taxel.cli.stages import stage_bars
from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files import read_cloud
from taxel.cloud.match import DRAWS, Match, likelihoods_of
from taxel.cloud.match import match as match_cloud
from taxel.cloud.models import chosen_models
from taxel.errors import TaxelError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS

DATASETS: Final = (".h5", ".hdf5")


@dataclass(frozen=True)
class Told:
    """The match of one cloud. true: the object that it is of, approach: the only one; "" where unknown, or all."""

    file: Path
    true: str
    approach: str
    match: Match

    def to_json(self) -> dict[str, Any]:
        """As plain numbers."""
        return {"object": self.true or None, "approach": self.approach or None, **self.match.to_json()}


def match(
    inputs: Annotated[list[Path], typer.Argument(help="Grasp datasets, or clouds: PLY, PCD, XYZ.", metavar="IN...")],
    item: Annotated[str, typer.Option("--object", help="Of a dataset: only this object; else all of them.")] = "",
    model: Annotated[
        list[str] | None, typer.Option(help="A shape or mesh file to match to; may be repeated. None: all shapes.")
    ] = None,
    each_approach: Annotated[
        bool, typer.Option("--each-approach", help="Also what the grasps of each approach tell alone.")
    ] = False,
    threshold: Annotated[
        float, typer.Option(help="Signal in counts above which a taxel is active.")
    ] = ACTIVE_SIGNAL_COUNTS,
    anywhere: Anywhere = False,
    draws: Annotated[int, typer.Option(help="Draws of grasps behind the confidence; 0: none.")] = DRAWS,
    seed: Annotated[int, typer.Option(help="Of those draws.")] = 0,
    unit: Unit = "m",
    as_json: AsJson = False,
) -> None:
    """Tell which shape a cloud is of: distances to every model after alignment, margin, confidence.

    A dataset, or a PLY made of one, also tells which taxels felt nothing. Then the best model is the one with the most
    evidence for what was felt and what was not, wherever the object lay a little aside; lead: by how much (natural
    logarithm).

    Example: taxel cloud match out/campaign/real.h5 out/campaign/sim.h5 --each-approach
    """
    if draws < 0 or seed < 0:
        raise TaxelError(f"--draws, --seed: expected 0 or more, found {min(draws, seed)}")
    models = chosen_models(model or (), metres(unit))
    found: list[Told] = []
    with stage_bars(hidden=as_json) as show:
        wholes = list(_clouds(inputs, item, threshold, show))
        total = sum(1 + len(cloud.approaches) * each_approach for _, _, cloud in wholes)
        for done, (path, true, cloud) in enumerate(wholes):
            for one in models.values():
                check_scale(cloud, one)

            def weighing(model: int, of: int, done: int = done) -> None:
                show("evidence", done * of + model, len(wholes) * of)

            told = None if anywhere or not len(cloud.quiet) else likelihoods_of(cloud, models, weighing)
            for approach in ("", *(cloud.approaches if each_approach else ())):
                show("matching", len(found), total)
                part = cloud.of_approach(approach) if approach else cloud
                best = match_cloud(part, models, placed=not anywhere, likelihoods=told, draws=draws, seed=seed)
                found.append(Told(path, true, approach, best))
        show("matching", total, total)
    if as_json:
        print(json.dumps({"matches": [one.to_json() for one in found], "told_right": _told_right(found)}))
    else:
        _print_matches(found)


def _clouds(
    inputs: list[Path], item: str, threshold: float, show: Callable[[str, int, int], None]
) -> Iterator[tuple[Path, str, ContactCloud]]:
    """Every cloud to be matched, with its file and the object that it is of, if known."""
    for path in inputs:
        whole = {"": read_cloud(path)} if path.suffix.lower() not in DATASETS else {}
        if not whole:
            with GraspDataset(path) as data:
                names = [item] if item else [name for name in data.objects if any(one.object == name for one in data)]
                for name in names:
                    told = accumulate(data, name, threshold, show=lambda done, total: show("reading", done, total))
                    whole[name] = told
        for name, cloud in whole.items():
            only_points(cloud)
            yield path, name, cloud


def _told_right(found: list[Told]) -> dict[str, dict[str, int]]:
    """Of whole clouds and of single approaches: how many were told right, and by the mean distance alone, of how many
    whose object is a model.
    """
    counts = {what: {"right": 0, "right_by_mean": 0, "total": 0} for what in ("clouds", "single_approaches")}
    for one in found:
        if one.true in {fit.model for fit in one.match.fits}:
            count = counts["single_approaches" if one.approach else "clouds"]
            count["right"] += one.match.best == one.true
            count["right_by_mean"] += one.match.best_by_mean == one.true
            count["total"] += 1
    return counts


def _print_matches(found: list[Told]) -> None:
    console = Console(markup=False)
    table = Table(title="best model of each cloud")
    for heading in ("cloud", "best", "mean mm", "margin", "lead", "sure"):
        table.add_column(
            heading, justify="left" if heading in ("cloud", "best") else "right", no_wrap=heading != "cloud"
        )
    for one in found:
        best, sure = one.match.fits[0], one.match.confidence
        table.add_row(
            " ".join(part.replace("_", " ") for part in (one.file.name, one.true, one.approach) if part),
            one.match.best.replace("_", " "),
            f"{1e3 * best.distances.mean_m:.2f}",
            "> 99" if one.match.margin > 99.0 else f"{one.match.margin:.2f}",
            "" if np.isnan(one.match.lead) else f"{one.match.lead:.0f}",
            "" if sure is None else f"{100.0 * sure[one.match.best]:.0f} %",
        )
    console.print(table)
    for what, count in _told_right(found).items():
        if count["total"]:
            alone = f"by the mean distance alone {count['right_by_mean']}"
            console.print(f"{what.replace('_', ' ')} told right: {count['right']} of {count['total']}; {alone}")
