"""`taxel cloud distance`, `align` and `sweep`: clouds against meshes and other clouds."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from taxel.cli.cloud_inputs import (
    Anywhere,
    CloudFile,
    Target,
    Unit,
    check_scale,
    load_target,
    require_nonempty,
)
from taxel.cli.options import AsJson, Overwrite
from taxel.cli.progress import stage_bars
from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, compute_distances_to_cloud, compute_distances_to_mesh
from taxel.cloud.files import read_cloud, require_new_file, write_cloud
from taxel.cloud.global_alignment import align_to_mesh_globally, align_to_points_globally
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import Alignment, PointTarget, align_to_mesh, align_to_points
from taxel.cloud.sweep import ForceRow, SorRow, convert_to_json, format_csv, sweep_force_filter, sweep_outlier_filter
from taxel.output import write_whole
from taxel.recording.grasp_dataset import GraspDataset
from taxel.types import FloatArray


def distance(cloud: CloudFile, target: Target, unit: Unit = "m", as_json: AsJson = False) -> None:
    """Measure the unsigned distances from a cloud to a surface or another cloud, without alignment.

    Example: taxel cloud distance out/cylinder.ply cylinder
    """
    contact_cloud, reference = _read_cloud_and_target(cloud, target, unit)
    stats = DistanceStats.from_distances(_compute_distances(contact_cloud, reference))
    if as_json:
        print(json.dumps({"cloud": str(cloud), "target": target, **stats.to_json()}))
    else:
        print(f"{cloud} to {target}: {_format_stats(stats)}")


def align(
    cloud: CloudFile,
    target: Target,
    out: Annotated[Path | None, typer.Option(help="File for the aligned cloud: .ply, .pcd or .xyz.")] = None,
    anywhere: Anywhere = False,
    sample_mesh: Annotated[
        bool, typer.Option("--sample-mesh", help="Align to 20,000 points sampled on the mesh instead of its surface.")
    ] = False,
    unit: Unit = "m",
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Align a cloud rigidly to a surface or another cloud by iterative closest points.

    Example: taxel cloud align out/real.ply out/sim.ply --out out/aligned.ply
    """
    if out is not None:
        require_new_file(out, overwrite)
    contact_cloud, reference = _read_cloud_and_target(cloud, target, unit)
    alignment = _align_cloud(contact_cloud, reference, is_global=anywhere, samples_mesh=sample_mesh)
    aligned_cloud = contact_cloud.transform(alignment.transform)
    stats = DistanceStats.from_distances(_compute_distances(aligned_cloud, reference))
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_cloud(aligned_cloud, out, overwrite=overwrite)
    if as_json:
        search = {"iterations": alignment.iterations, "converged": alignment.converged}
        print(json.dumps({**stats.to_json(), **search, "transform": alignment.transform.tolist()}))
        return
    iterations = f"after {alignment.iterations} iterations" + ("" if alignment.converged else ", not converged")
    print(f"{cloud} to {target}, {iterations}: {_format_stats(stats)}")
    for row in alignment.transform:
        print("  " + " ".join(f"{value:12.8f}" for value in row))


def sweep(
    dataset: Annotated[Path, typer.Argument(help="Grasp dataset of a hand or a simulator.", metavar="DATASET.h5")],
    object_name: Annotated[str, typer.Option("--object", help="Object whose grasps are accumulated.")],
    out: Annotated[Path, typer.Option(help="Folder for force_filter.csv and sor.csv.")],
    overwrite: Overwrite = False,
    print_json: AsJson = False,
) -> None:
    """Vary the force filter and the outlier filter, and measure the distances to the object (Tables I-1 to I-6).

    Example: taxel cloud sweep out/campaign/real.h5 --object cylinder --out out/sweep
    """
    paths = (out / "force_filter.csv", out / "sor.csv")
    for path in paths:
        require_new_file(path, overwrite)
    with GraspDataset(dataset) as data, stage_bars(hidden=print_json) as show:
        cloud = accumulate(data, object_name, progress=lambda done, total: show("reading", done, total))
        require_nonempty(cloud)
        mesh = TriangleMesh(
            f"{dataset}, {object_name}", data.objects[object_name].vertices, data.objects[object_name].faces
        )
        force = sweep_force_filter(
            cloud, mesh, object_name, progress=lambda done, total: show("force filter", done, total)
        )
        sor = sweep_outlier_filter(
            cloud, mesh, object_name, progress=lambda done, total: show("outlier filter", done, total)
        )
    out.mkdir(parents=True, exist_ok=True)
    write_whole(paths[0], format_csv(force))
    write_whole(paths[1], format_csv(sor))
    if print_json:
        print(json.dumps({"force_filter": convert_to_json(force), "sor": convert_to_json(sor)}))
    else:
        _print_rows(force, sor)
        print(f"tables: {paths[0]}, {paths[1]}")


def _read_cloud_and_target(path: Path, target: str, unit: str) -> tuple[ContactCloud, TriangleMesh | ContactCloud]:
    """Read the contact cloud of a file, and the target (shape, mesh or cloud) to compare with.

    unit: length unit of a mesh file. Raises TaxelError for an empty cloud or a mesh in another unit.
    """
    cloud = read_cloud(path)
    require_nonempty(cloud)
    reference = load_target(target, unit)
    if isinstance(reference, TriangleMesh):
        check_scale(cloud, reference)
    return cloud, reference


def _compute_distances(cloud: ContactCloud, reference: TriangleMesh | ContactCloud) -> FloatArray:
    """Compute the distance of each point of a cloud to the target, a mesh or another cloud, f64[N], metres."""
    if isinstance(reference, TriangleMesh):
        return compute_distances_to_mesh(cloud.points, reference, cloud.name)
    return compute_distances_to_cloud(cloud.points, reference.points, cloud.name, reference.name)


def _align_cloud(
    cloud: ContactCloud, reference: TriangleMesh | ContactCloud, *, is_global: bool, samples_mesh: bool
) -> Alignment:
    """Align a cloud to a mesh or to another cloud; return the transformation and its convergence.

    is_global: search from any initial pose; otherwise the search starts at the given pose. samples_mesh: align to
    points sampled on the mesh instead of its surface.
    """
    if isinstance(reference, TriangleMesh) and not samples_mesh:
        align_mesh = align_to_mesh_globally if is_global else align_to_mesh
        return align_mesh(cloud.points, reference, name=cloud.name)
    target = (
        PointTarget.from_mesh(reference)
        if isinstance(reference, TriangleMesh)
        else PointTarget(reference.points, reference.name)
    )
    if is_global:
        return align_to_points_globally(cloud.points, target, name=cloud.name)
    return align_to_points(cloud.points, target, name=cloud.name)


def _format_stats(stats: DistanceStats) -> str:
    """Format the number of points and the distances, in millimetres, as one line of text."""
    values = (("mean", stats.mean_m), ("standard deviation", stats.std_m), ("largest", stats.max_m))
    text = ", ".join(f"{name} {1e3 * value:.3f}" for name, value in (*values, ("RMS", stats.rms_m)))
    return f"{stats.points} points, {text} mm"


def _print_rows(force: list[ForceRow], sor: list[SorRow]) -> None:
    """Print the results of the parameter sweeps of the force filter and of the outlier filter (SOR) as two tables."""
    console = Console(markup=False)
    for title, settings, rows in (
        ("force filter", ("counts",), [((f"{row.threshold_counts:g}",), row) for row in force]),
        ("outlier filter", ("N", "nSigma"), [((str(row.n_neighbors), f"{row.n_sigma:g}"), row) for row in sor]),
    ):
        table = Table(title=title)
        for heading in (*settings, "points", "removed %", "RMS mm", "mean mm", "largest mm"):
            table.add_column(heading, justify="right")
        for values, row in rows:
            lengths = (f"{1e3 * value:.3f}" for value in (row.rms_m, row.mean_m, row.max_m))
            table.add_row(*values, str(row.points), f"{row.filtered_out_percent:.1f}", *lengths)
        console.print(table)
