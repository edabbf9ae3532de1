"""`taxel cloud match`: the shape of the object in a cloud."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from taxel.cli.cloud_inputs import Anywhere, Unit, check_scale, metres, require_nonempty
from taxel.cli.options import AsJson, ThresholdCounts
from taxel.cli.progress import ShowStage, stage_bars
from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files import read_cloud
from taxel.cloud.match import BOOTSTRAP_SAMPLES, Match, compute_likelihoods
from taxel.cloud.match import match as match_cloud
from taxel.cloud.models import load_models
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS

DATASETS: Final = (".h5", ".hdf5")


@dataclass(frozen=True)
class CloudMatch:
    """Result of matching one contact cloud with shape models.

    file: file of the cloud. true_object: the grasped object, "" if unknown. approach: approach of the matched grasps,
    "" for all approaches. match: comparison with all models.
    """

    file: Path
    true_object: str
    approach: str
    match: Match

    def to_json(self) -> dict[str, Any]:
        """Return the result of matching one cloud with shape models as JSON values."""
        return {"object": self.true_object or None, "approach": self.approach or None, **self.match.to_json()}


def match(
    inputs: Annotated[
        list[Path], typer.Argument(help="Grasp datasets, or cloud files: PLY, PCD, XYZ.", metavar="SOURCE...")
    ],
    object_name: Annotated[
        str | None, typer.Option("--object", help="Only grasps of this object. Default: all objects of a dataset.")
    ] = None,
    model: Annotated[
        list[str] | None, typer.Option(help="Shape or mesh file to compare with; repeatable. Default: all shapes.")
    ] = None,
    each_approach: Annotated[
        bool, typer.Option("--each-approach", help="Also match the grasps of each approach alone.")
    ] = False,
    threshold_counts: ThresholdCounts = ACTIVE_SIGNAL_COUNTS,
    anywhere: Anywhere = False,
    resamples: Annotated[
        int, typer.Option(min=0, help="Number of resamples of the grasps, which give the confidence.")
    ] = BOOTSTRAP_SAMPLES,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the resamples.")] = 0,
    unit: Unit = "m",
    as_json: AsJson = False,
) -> None:
    """Identify the shape of the object in a cloud: distances to each model after alignment, margin, confidence.

    A dataset, or a PLY file made from one, also contains the inactive taxels. Then the best model is the one with the
    largest evidence for the active and inactive taxels, averaged over small displacements of the object. margin:
    smallest mean distance to another model, divided by the mean distance to the best model. lead: natural logarithm of
    the ratio of the evidences of the best and the second model.

    Example: taxel cloud match out/campaign/real.h5 out/campaign/sim.h5 --each-approach
    """
    models = load_models(model or (), metres(unit))
    matches: list[CloudMatch] = []
    with stage_bars(hidden=as_json) as show:
        clouds = list(_read_clouds(inputs, object_name, threshold_counts, show))
        total = sum(1 + len(cloud.approaches) * each_approach for _, _, cloud in clouds)
        for index, (path, true_object, cloud) in enumerate(clouds):
            for mesh in models.values():
                check_scale(cloud, mesh)

            def show_evidence(model: int, count: int, index: int = index) -> None:
                """Show the progress of the evidence over all clouds. model: number of finished models of `count`."""
                show("evidence", index * count + model, len(clouds) * count)

            has_evidence = not anywhere and len(cloud.inactive_points) > 0
            likelihoods = compute_likelihoods(cloud, models, show_evidence) if has_evidence else None
            for approach in ("", *(cloud.approaches if each_approach else ())):
                show("matching", len(matches), total)
                selection = cloud.select_approach(approach) if approach else cloud
                result = match_cloud(
                    selection,
                    models,
                    in_model_frame=not anywhere,
                    likelihoods=likelihoods,
                    bootstrap_samples=resamples,
                    seed=seed,
                )
                matches.append(CloudMatch(path, true_object, approach, result))
        show("matching", total, total)
    if as_json:
        content = {"matches": [cloud_match.to_json() for cloud_match in matches], "correct": _count_correct(matches)}
        print(json.dumps(content))
    else:
        _print_matches(matches)


def _read_clouds(
    inputs: list[Path], object_name: str | None, threshold_counts: float, show: ShowStage
) -> Iterator[tuple[Path, str, ContactCloud]]:
    """Yield each contact cloud to match, with its file and the name of the grasped object ("" for a cloud file).

    inputs: grasp datasets or cloud files. object_name: only this object of a dataset; None: all objects. Of a dataset,
    taxels with a signal above `threshold_counts` give points. show: displays the progress of a stage. Raises TaxelError
    for an empty cloud.
    """
    for path in inputs:
        clouds = {"": read_cloud(path)} if path.suffix.lower() not in DATASETS else {}
        if not clouds:
            with GraspDataset(path) as data:
                grasped = [name for name in data.objects if any(grasp.object == name for grasp in data)]
                for name in grasped if object_name is None else [object_name]:
                    clouds[name] = accumulate(
                        data, name, threshold_counts, progress=lambda done, total: show("reading", done, total)
                    )
        for name, cloud in clouds.items():
            require_nonempty(cloud)
            yield path, name, cloud


def _count_correct(matches: list[CloudMatch]) -> dict[str, dict[str, int]]:
    """Count the clouds with a known object, in total and with a correctly identified shape.

    Returns the counts total, right (best model) and right_by_mean (model with the smallest mean distance), separately
    for whole clouds ("clouds") and for the grasps of one approach ("single_approaches").
    """
    counts = {group: {"right": 0, "right_by_mean": 0, "total": 0} for group in ("clouds", "single_approaches")}
    for cloud_match in matches:
        if cloud_match.true_object in {fit.model for fit in cloud_match.match.fits}:
            count = counts["single_approaches" if cloud_match.approach else "clouds"]
            count["right"] += cloud_match.match.best == cloud_match.true_object
            count["right_by_mean"] += cloud_match.match.best_by_mean == cloud_match.true_object
            count["total"] += 1
    return counts


def _print_matches(matches: list[CloudMatch]) -> None:
    """Print a table with the best shape model of each cloud, and the number of correctly identified shapes.

    mean: mean distance between the points and the surface of the best model. margin: smallest mean distance to another
    model / mean distance to the best. lead: natural logarithm of the ratio of the evidence of the best model to that of
    the second best. confidence: share of bootstrap samples with the same best model.
    """
    console = Console(markup=False)
    table = Table(title="best model of each cloud")
    for heading in ("cloud", "best", "mean mm", "margin", "lead", "confidence"):
        table.add_column(
            heading, justify="left" if heading in ("cloud", "best") else "right", no_wrap=heading != "cloud"
        )
    for cloud_match in matches:
        result = cloud_match.match
        labels = (cloud_match.file.name, cloud_match.true_object, cloud_match.approach)
        confidence = result.confidence
        table.add_row(
            " ".join(label.replace("_", " ") for label in labels if label),
            result.best.replace("_", " "),
            f"{1e3 * result.fits[0].distances.mean_m:.2f}",
            "> 99" if result.margin > 99.0 else f"{result.margin:.2f}",
            "" if np.isnan(result.lead) else f"{result.lead:.0f}",
            "" if confidence is None else f"{100.0 * confidence[result.best]:.0f} %",
        )
    console.print(table)
    for group, count in _count_correct(matches).items():
        if count["total"]:
            by_mean = f"by the mean distance alone {count['right_by_mean']}"
            console.print(f"{group.replace('_', ' ')} identified: {count['right']} of {count['total']}; {by_mean}")
