"""Figures of the thesis that show contact clouds, with the edges of the objects, in three dimensions."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.hand.transforms import apply
from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.figure_style import COLOURS, EDGE, INACTIVE, new_figure
from taxel.thesis.matching import ObjectClouds
from taxel.thesis.printed import STAGES
from taxel.types import FloatArray

VIEW: Final = (18.0, -60.0)

SHARP_COS: Final = 0.9
"""Cosine of the angle between face normals below which an edge is drawn."""


def _draw_clouds(
    axis: Any,
    clouds: Mapping[str, tuple[FloatArray, str]],
    mesh: TriangleMesh | None,
    title: str,
    size: float = 2.5,
) -> None:
    """Draw clouds, and the sharp edges of a mesh, on a 3-D axis in millimetres.

    clouds: points f64[n, 3] (metres) and colour by label. mesh: mesh of the object; None: no mesh. size: area of a
    point in square points.
    """
    all_points = [points for points, _ in clouds.values()] + ([mesh.vertices] if mesh is not None else [])
    low, high = (1e3 * f(np.concatenate(all_points), axis=0) for f in (np.min, np.max))
    centre, half = 0.5 * (low + high), 0.5 * float((high - low).max())
    if mesh is not None:
        for corners in _find_sharp_edges(mesh):
            axis.plot(*(1e3 * corners.T), color=EDGE, linewidth=0.8)
    for label, (points, colour) in clouds.items():
        axis.scatter(*(1e3 * points.T), s=size, c=colour, alpha=0.5, linewidths=0, label=label)
    axis.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))
    axis.set_zlim(centre[2] - half, centre[2] + half)
    axis.set_box_aspect((1, 1, 1), zoom=0.92)
    axis.view_init(*VIEW)
    axis.set_title(title, fontsize=10, y=0.98)
    axis.tick_params(labelsize=6)
    axis.set_xlabel("mm", fontsize=7)


def _find_sharp_edges(mesh: TriangleMesh) -> list[FloatArray]:
    """Find the edges between mesh faces of different directions, each as its two end points f64[2, 3].

    A round side has no sharp edges except its rims.
    """
    owners: dict[tuple[int, int], list[int]] = {}
    for number, face in enumerate(mesh.faces.tolist()):
        for first, second in ((0, 1), (1, 2), (2, 0)):
            owners.setdefault((min(face[first], face[second]), max(face[first], face[second])), []).append(number)
    normals = mesh.normals
    sharp = [key for key, faces in owners.items() if normals[faces[0]] @ normals[faces[-1]] < SHARP_COS]
    return [mesh.vertices[list(key)] for key in sharp]


def draw_grasp(item: ObjectClouds) -> Any:
    """Draw Figure 5.3 of the thesis: active and inactive taxels of one grasp, real and simulated.

    The grasp is selected for many active taxels on both sides: the smaller of its two numbers of active taxels, real
    and simulated, is the largest of all grasps.
    """
    real, sim = item.clouds[REAL], item.clouds[SIM]
    active = [np.bincount(cloud.grasp, minlength=len(cloud.grasps)) for cloud in (real, sim)]
    counts = [dict(zip(cloud.grasps, values, strict=True)) for cloud, values in zip((real, sim), active, strict=True)]
    grasp = max(real.grasps, key=lambda name: min(counts[0][name], counts[1].get(name, -1)))
    figure = new_figure(9.0, 4.6)
    for column, (name, cloud) in enumerate(((REAL, real), (SIM, sim))):
        row = cloud.grasps.index(grasp) if grasp in cloud.grasps else 0
        inactive = cloud.inactive_points[cloud.inactive_grasp == row]
        points = cloud.points[cloud.grasp == row]
        clouds = {"inactive": (inactive, INACTIVE), "active": (points, COLOURS[name])}
        axis = figure.add_subplot(1, 2, column + 1, projection="3d")
        title = f"{name}: {len(points)} of {len(points) + len(inactive)} taxels active"
        _draw_clouds(axis, clouds, item.mesh, title, size=7.0)
        axis.legend(loc="lower left", fontsize=8, markerscale=2)
    return figure


def draw_accumulated(items: Sequence[ObjectClouds]) -> Any:
    """Draw Figure 5.6 of the thesis: untreated real and simulated cloud of each object, in separate plots."""
    figure = new_figure(4.0 * len(items), 7.6)
    for column, item in enumerate(items):
        for row, name in enumerate((REAL, SIM)):
            axis = figure.add_subplot(2, len(items), row * len(items) + column + 1, projection="3d")
            cloud = item.clouds[name]
            title = f"{item.printed_name}, {name}: {len(cloud)} points"
            _draw_clouds(axis, {name: (cloud.points, COLOURS[name])}, item.mesh, title)
    return figure


def draw_on_cad(items: Sequence[ObjectClouds]) -> Any:
    """Draw Figure 5.7 of the thesis: real and simulated cloud of each object, each aligned to the object's CAD
    model.
    """
    figure = new_figure(4.0 * len(items), 4.1)
    for column, item in enumerate(items):
        aligned = {
            name: (
                _transform(item.clouds[name], align_to_mesh(item.clouds[name].points, item.mesh).transform),
                COLOURS[name],
            )
            for name in (REAL, SIM)
        }
        axis = figure.add_subplot(1, len(items), column + 1, projection="3d")
        _draw_clouds(axis, aligned, item.mesh, f"{item.printed_name} on its CAD model")
    figure.axes[0].legend(loc="upper left", fontsize=8, markerscale=3)
    return figure


def draw_on_sim(items: Sequence[ObjectClouds]) -> Any:
    """Draw Figure 5.8 of the thesis: the simulated cloud of each object, and the real cloud after alignment to the
    simulated cloud.
    """
    figure = new_figure(4.0 * len(items), 4.1)
    for column, item in enumerate(items):
        target = item.clouds[SIM].points
        transform = align_to_points(item.clouds[REAL].points, PointTarget(target)).transform
        axis = figure.add_subplot(1, len(items), column + 1, projection="3d")
        aligned = {REAL: (_transform(item.clouds[REAL], transform), COLOURS[REAL]), SIM: (target, COLOURS[SIM])}
        _draw_clouds(axis, aligned, None, f"{item.printed_name}, real on simulated")
    figure.axes[0].legend(loc="upper left", fontsize=8, markerscale=3)
    return figure


def _transform(cloud: ContactCloud, transform: FloatArray) -> FloatArray:
    """Return the points of a cloud after a rigid transform f64[4, 4], f64[n, 3]."""
    return np.asarray(apply(transform, cloud.points))


def draw_progress(item: ObjectClouds) -> Any:
    """Draw Figure 5.11, I-2 or I-3 of the thesis: real and simulated cloud of one object at each treatment stage."""
    steps = ((REAL, SIM), (FILTERED, SIM), (CLEANED, SIM), (CLEANED, SPREAD))
    figure = new_figure(4.0 * len(steps), 4.1)
    for column, (real, sim) in enumerate(steps):
        axis = figure.add_subplot(1, len(steps), column + 1, projection="3d")
        clouds = {name: (item.clouds[name].points, COLOURS[name]) for name in (real, sim)}
        _draw_clouds(axis, clouds, None, STAGES[column].replace("+ ", " and ").replace("+", " and"))
        axis.legend(loc="lower left", fontsize=7, markerscale=3)
    return figure
