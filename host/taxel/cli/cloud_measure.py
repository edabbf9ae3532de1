"""`taxel cloud distance`, `align` and `sweep`: what clouds measure against meshes and clouds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from taxel.cli.cloud_inputs import (
    Anywhere,
    AsJson,
    CloudFile,
    Overwrite,
    Target,
    Unit,
    check_scale,
    only_points,
    target_of,
)
from taxel.cli.stages import stage_bars
from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, distances_to_cloud, distances_to_mesh
from taxel.cloud.files import read_cloud, require_free, write_cloud
from taxel.cloud.first_guess import align_to_mesh_from_anywhere, align_to_points_from_anywhere
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import Alignment, PointTarget, align_to_mesh, align_to_points
from taxel.cloud.sweep import ForceRow, SorRow, as_json, force_sweep, sor_sweep, to_csv
from taxel.recording.grasp_dataset import GraspDataset
from taxel.types import FloatArray


def distance(cloud: CloudFile, target: Target, unit: Unit = "m", as_json: AsJson = False) -> None:
    """Unsigned distances of a cloud's points to a surface or another cloud, where they are: nothing is aligned.

    Example: taxel cloud distance out/cylinder.ply cylinder
    """
    points, there = _both(cloud, target, unit)
    stats = DistanceStats.of(_distances(points.points, points.name, there))
    if as_json:
        print(json.dumps({"cloud": str(cloud), "target": target, **stats.to_json()}))
    else:
        print(f"{cloud} to {target}: {_in_words(stats)}")


def align(
    cloud: CloudFile,
    target: Target,
    out: Annotated[Path | None, typer.Option(help="Write the aligned cloud: .ply, .pcd or .xyz.")] = None,
    anywhere: Anywhere = False,
    sampled: Annotated[bool, typer.Option("--sampled", help="To 20,000 points on the mesh, not its surface.")] = False,
    unit: Unit = "m",
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Align a cloud rigidly to a surface or another cloud by iterative closest points.

    Example: taxel cloud align out/real.ply out/sim.ply --out out/aligned.ply
    """
    if out is not None:
        require_free(out, overwrite)
    points, there = _both(cloud, target, unit)
    found = _aligned(points, there, anywhere, sampled)
    moved = points.moved(found.transform)
    stats = DistanceStats.of(_distances(moved.points, points.name, there))
    if out is not None:
        out.parent.mkdir(parents=True, exist_ok=True)
        write_cloud(moved, out, overwrite=overwrite)
    if as_json:
        ran = {"iterations": found.iterations, "converged": found.converged}
        print(json.dumps({**stats.to_json(), **ran, "transform": found.transform.tolist()}))
        return
    ended = f"after {found.iterations} iterations" + ("" if found.converged else ", not converged")
    print(f"{cloud} to {target}, {ended}: {_in_words(stats)}")
    for row in found.transform:
        print("  " + " ".join(f"{value:12.8f}" for value in row))


def sweep(
    dataset: Annotated[Path, typer.Argument(help="Grasp dataset of a hand or a simulator.", metavar="DATASET.h5")],
    item: Annotated[str, typer.Option("--object", help="The object.")],
    out: Annotated[Path, typer.Option(help="Folder for force_filter.csv and sor.csv.")],
    overwrite: Overwrite = False,
    as_json_too: AsJson = False,
) -> None:
    """How the match with the object changes with the force filter and the outlier filter: Tables I-1 to I-6.

    Example: taxel cloud sweep out/campaign/real.h5 --object cylinder --out out/sweep
    """
    paths = (out / "force_filter.csv", out / "sor.csv")
    for path in paths:
        require_free(path, overwrite)
    with GraspDataset(dataset) as data, stage_bars(hidden=as_json_too) as show:
        cloud = accumulate(data, item, show=lambda done, total: show("reading", done, total))
        only_points(cloud)
        solid = TriangleMesh(f"{dataset}, {item}", data.objects[item].vertices, data.objects[item].faces)
        force = force_sweep(cloud, solid, item, show=lambda done, total: show("force filter", done, total))
        sor = sor_sweep(cloud, solid, item, show=lambda done, total: show("outlier filter", done, total))
    out.mkdir(parents=True, exist_ok=True)
    paths[0].write_text(to_csv(force))
    paths[1].write_text(to_csv(sor))
    if as_json_too:
        print(json.dumps({"force_filter": as_json(force), "sor": as_json(sor)}))
    else:
        _print_rows(force, sor)
        print(f"tables: {paths[0]}, {paths[1]}")


def _both(cloud: Path, target: str, unit: str) -> tuple[ContactCloud, TriangleMesh | ContactCloud]:
    points = read_cloud(cloud)
    only_points(points)
    there = target_of(target, unit)
    if isinstance(there, TriangleMesh):
        check_scale(points, there)
    return points, there


def _distances(points: FloatArray, name: str, there: TriangleMesh | ContactCloud) -> FloatArray:
    if isinstance(there, TriangleMesh):
        return distances_to_mesh(points, there, name)
    return distances_to_cloud(points, there.points, name, there.name)


def _aligned(cloud: ContactCloud, there: TriangleMesh | ContactCloud, anywhere: bool, sampled: bool) -> Alignment:
    if isinstance(there, TriangleMesh) and not sampled:
        mesh_align = align_to_mesh_from_anywhere if anywhere else align_to_mesh
        return mesh_align(cloud.points, there, name=cloud.name)
    target = PointTarget.on_mesh(there) if isinstance(there, TriangleMesh) else PointTarget(there.points, there.name)
    if anywhere:
        return align_to_points_from_anywhere(cloud.points, target, name=cloud.name)
    return align_to_points(cloud.points, target, name=cloud.name)


def _in_words(stats: DistanceStats) -> str:
    values = (("mean", stats.mean_m), ("standard deviation", stats.std_m), ("largest", stats.max_m))
    told = ", ".join(f"{name} {1e3 * value:.3f}" for name, value in (*values, ("RMS", stats.rms_m)))
    return f"{stats.points} points, {told} mm"


def _print_rows(force: list[ForceRow], sor: list[SorRow]) -> None:
    console = Console(markup=False)
    for title, first, rows in (
        ("force filter", ("counts",), [((f"{row.threshold_counts:g}",), row) for row in force]),
        ("outlier filter", ("N", "nSigma"), [((str(row.n_neighbors), f"{row.n_sigma:g}"), row) for row in sor]),
    ):
        table = Table(title=title)
        for heading in (*first, "points", "removed %", "RMS mm", "mean mm", "largest mm"):
            table.add_column(heading, justify="right")
        for setting, row in rows:
            lengths = (f"{1e3 * value:.3f}" for value in (row.rms_m, row.mean_m, row.max_m))
            table.add_row(*setting, str(row.points), f"{row.filtered_out_percent:.1f}", *lengths)
        console.print(table)
