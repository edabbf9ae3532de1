"""`taxel cloud`: contact clouds made, filtered, converted, aligned, measured, and matched to shapes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from taxel.cli.cloud_inputs import AsJson, CloudFile, Out, Overwrite, Unit, metres, only_points
from taxel.cli.cloud_match import match
from taxel.cli.cloud_measure import align, distance, sweep
from taxel.cli.stages import stage_bars
from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files import holds_mesh, read_cloud, read_mesh, require_free, write_cloud, write_mesh
from taxel.cloud.filters import force_filter, without_outliers
from taxel.cloud.fusion import fused
from taxel.cloud.propagation import Propagation
from taxel.errors import TaxelError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS

cloud_app = typer.Typer(
    help="Contact clouds of grasped objects: make, filter, align, measure, tell the shape.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@cloud_app.command()
def make(
    dataset: Annotated[Path, typer.Argument(help="Grasp dataset of a hand or a simulator.", metavar="DATASET.h5")],
    item: Annotated[str, typer.Option("--object", help="The object whose grasps are accumulated.")],
    out: Out,
    threshold: Annotated[
        float, typer.Option(help="Signal in counts above which a taxel is active.")
    ] = ACTIVE_SIGNAL_COUNTS,
    approach: Annotated[str, typer.Option(help="Only grasps of this approach.")] = "",
    propagate_mm: Annotated[
        float, typer.Option(help="Active taxels activate those of their board that are nearer; 5.5: the four beside.")
    ] = 0.0,
    fuse: Annotated[bool, typer.Option("--fuse", help="Average the same contact over an approach's repeats.")] = False,
    least_share: Annotated[float, typer.Option(help="With --fuse: share of the repeats that a contact needs.")] = 0.0,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Accumulate the contact points of all grasps of an object, in the object's frame.

    Example: taxel cloud make out/campaign/real.h5 --object cylinder --out out/cylinder.ply
    """
    require_free(out, overwrite)
    if not np.isfinite(threshold) or threshold < 0.0:
        raise TaxelError(f"--threshold: expected counts of 0 or more, found {threshold:g}")
    if not 0.0 <= propagate_mm <= 100.0 or not 0.0 <= least_share <= 1.0:
        raise TaxelError("--propagate-mm: expected 0 to 100, and --least-share: 0 to 1; correct them")
    spread = Propagation(1e-3 * propagate_mm) if propagate_mm else None
    with GraspDataset(dataset) as data, stage_bars(hidden=as_json) as show:
        told = accumulate(
            data, item, threshold, propagation=spread, show=lambda done, total: show("reading", done, total)
        )
    chosen = told.of_approach(approach) if approach else told
    _store(fused(chosen, least_share) if fuse else chosen, out, as_json, overwrite)


@cloud_app.command(name="filter")
def filter_cloud(
    cloud: CloudFile,
    out: Out,
    threshold: Annotated[
        float | None, typer.Option(help="Signal in counts; points with a smaller signal are removed.")
    ] = None,
    sor_points: Annotated[int | None, typer.Option(help="N of the outlier filter; a point counts itself.")] = None,
    sor_sigma: Annotated[float | None, typer.Option(help="nSigma of the outlier filter.")] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Filter a cloud by force, then by statistical outliers, as CloudCompare does.

    Example: taxel cloud filter out/cylinder.ply --out out/clean.ply --threshold 190 --sor-points 20 --sor-sigma 2
    """
    require_free(out, overwrite)
    if (sor_points is None) != (sor_sigma is None):
        raise TaxelError("--sor-points, --sor-sigma: expected both or none, found one; add the other")
    if threshold is None and sor_points is None:
        raise TaxelError("filter: expected --threshold, or --sor-points and --sor-sigma, found neither; give one")
    found = read_cloud(cloud)
    only_points(found)
    if threshold is not None:
        found = force_filter(found, threshold)
    if sor_points is not None and sor_sigma is not None:
        if not np.isfinite(sor_sigma):
            raise TaxelError(f"--sor-sigma: expected a number, found {sor_sigma:g}")
        found = without_outliers(found, sor_points, sor_sigma)
    _store(found, out, as_json, overwrite)


@cloud_app.command()
def convert(
    source: Annotated[Path, typer.Argument(help="PLY, PCD, XYZ, STL or OBJ.", metavar="IN")],
    out: Annotated[Path, typer.Argument(help="The file to write; its ending is its format.", metavar="OUT")],
    unit: Unit = "m",
    overwrite: Overwrite = False,
) -> None:
    """Convert a cloud (PLY, PCD, XYZ) or a mesh (STL, OBJ, PLY) to another format.

    Example: taxel cloud convert part.stl part.ply --unit mm
    """
    require_free(out, overwrite)
    if holds_mesh(source):
        mesh = read_mesh(source, metres(unit))
        write_mesh(mesh, out, overwrite=overwrite)
        print(f"{out}: {len(mesh.vertices)} vertices, {len(mesh.faces)} triangles")
    else:
        cloud = read_cloud(source)
        write_cloud(cloud, out, overwrite=overwrite)
        print(f"{out}: {len(cloud)} points")


def _store(cloud: ContactCloud, out: Path, as_json: bool, overwrite: bool) -> None:
    """Write a cloud that is not empty, and say what is in it."""
    only_points(cloud)
    out.parent.mkdir(parents=True, exist_ok=True)
    write_cloud(cloud, out, overwrite=overwrite)
    grasps = len(np.unique(cloud.grasp))
    if as_json:
        print(json.dumps({"file": str(out), "points": len(cloud), "grasps": grasps}))
    else:
        print(f"{out}: {len(cloud)} points of {grasps} grasp{'s' if grasps != 1 else ''}")


cloud_app.command()(distance)
cloud_app.command()(align)
cloud_app.command()(match)
cloud_app.command()(sweep)
