"""`taxel cloud`: contact clouds."""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from taxel.cli.cloud_inputs import CloudFile, Out, Unit, metres, require_nonempty
from taxel.cli.cloud_match import match
from taxel.cli.cloud_measure import align, distance, sweep
from taxel.cli.options import AsJson, Overwrite, ThresholdCounts
from taxel.cli.progress import stage_bars
from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files import has_triangles, read_cloud, read_mesh, require_new_file, write_cloud, write_mesh
from taxel.cloud.filters import filter_by_force, remove_outliers
from taxel.cloud.fusion import fuse_repeats
from taxel.cloud.propagation import Propagation
from taxel.errors import TaxelError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS

cloud_app = typer.Typer(
    help="Filter, align, measure and match contact clouds.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@cloud_app.command()
def make(
    dataset: Annotated[Path, typer.Argument(help="Grasp dataset of a hand or a simulator.", metavar="DATASET.h5")],
    object_name: Annotated[str, typer.Option("--object", help="Object whose grasps are accumulated.")],
    out: Out,
    threshold_counts: ThresholdCounts = ACTIVE_SIGNAL_COUNTS,
    approach: Annotated[str | None, typer.Option(help="Only grasps of this approach. Default: all approaches.")] = None,
    propagate_mm: Annotated[
        float | None,
        typer.Option(min=0.0, max=100.0, help="Active taxels activate all taxels of their board within this distance."),
    ] = None,
    fuse: Annotated[bool, typer.Option("--fuse", help="Average each contact over the repeats of an approach.")] = False,
    min_share: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, help="With --fuse: smallest share of the repeats that contain the contact."),
    ] = 0.0,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Accumulate the contact points of all grasps of an object, in the object's frame.

    Example: taxel cloud make out/campaign/real.h5 --object cylinder --out out/cylinder.ply
    """
    require_new_file(out, overwrite)
    propagation = Propagation(1e-3 * propagate_mm) if propagate_mm is not None else None
    with GraspDataset(dataset) as data, stage_bars(hidden=as_json) as show:
        cloud = accumulate(
            data,
            object_name,
            threshold_counts,
            propagation=propagation,
            progress=lambda done, total: show("reading", done, total),
        )
    if approach is not None:
        cloud = cloud.select_approach(approach)
    _store(fuse_repeats(cloud, min_share) if fuse else cloud, out, as_json, overwrite)


@cloud_app.command(name="filter")
def filter_cloud(
    cloud: CloudFile,
    out: Out,
    threshold_counts: Annotated[float | None, typer.Option(help="Remove points with a smaller signal, counts.")] = None,
    sor_points: Annotated[
        int | None, typer.Option(help="Statistical outlier removal: number of points N, the point itself included.")
    ] = None,
    sor_sigma: Annotated[float | None, typer.Option(help="Statistical outlier removal: nSigma.")] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Filter a cloud by signal, then by statistical outlier removal with the definition of CloudCompare.

    Example: taxel cloud filter out/cylinder.ply --out clean.ply --threshold-counts 190 --sor-points 20 --sor-sigma 2
    """
    require_new_file(out, overwrite)
    if (sor_points is None) != (sor_sigma is None):
        raise TaxelError("--sor-points and --sor-sigma: expected both or none, found one; give both")
    if threshold_counts is None and sor_points is None:
        raise TaxelError("cloud filter: found no filter; give --threshold-counts, or --sor-points and --sor-sigma")
    points = read_cloud(cloud)
    require_nonempty(points)
    if threshold_counts is not None:
        points = filter_by_force(points, threshold_counts)
    if sor_points is not None and sor_sigma is not None:
        if not np.isfinite(sor_sigma):
            raise TaxelError(f"--sor-sigma: expected a number, found {sor_sigma:g}")
        points = remove_outliers(points, sor_points, sor_sigma)
    _store(points, out, as_json, overwrite)


@cloud_app.command()
def convert(
    source: Annotated[Path, typer.Argument(help="PLY, PCD, XYZ, STL or OBJ.", metavar="SOURCE")],
    out: Annotated[Path, typer.Argument(help="File to write; the suffix selects the format.", metavar="TARGET")],
    unit: Unit = "m",
    overwrite: Overwrite = False,
) -> None:
    """Convert a cloud (PLY, PCD, XYZ) or a mesh (STL, OBJ, PLY) to another format.

    Example: taxel cloud convert part.stl part.ply --unit mm
    """
    require_new_file(out, overwrite)
    if has_triangles(source):
        mesh = read_mesh(source, metres(unit))
        write_mesh(mesh, out, overwrite=overwrite)
        print(f"{out}: {len(mesh.vertices)} vertices, {len(mesh.faces)} triangles")
    else:
        cloud = read_cloud(source)
        write_cloud(cloud, out, overwrite=overwrite)
        print(f"{out}: {len(cloud)} points")


def _store(cloud: ContactCloud, out: Path, as_json: bool, overwrite: bool) -> None:
    """Write a contact cloud to the file `out`, and print its numbers of points and grasps.

    as_json: print one JSON object instead of text. overwrite: replace an existing file. Raises TaxelError for an empty
    cloud.
    """
    require_nonempty(cloud)
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
