"""Pictures of a campaign: each object's accumulated contact points, and one grasp with active and inactive taxels."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.cloud.accumulate import accumulate
from taxel.cloud.contacts import count_baseline_frames, locate_taxels, select_used_taxels
from taxel.hand.transforms import apply
from taxel.output.figure import save_figure
from taxel.recording.grasp_dataset import GraspDataset
from taxel.types import FloatArray

VIEW = (18.0, -60.0)
"""Elevation and azimuth of every picture, degrees."""

TICK_MM = 20.0

MAX_OBJECTS = 8
"""Largest number of columns in a picture; a generated shard has a different object in every grasp."""

MANY_POINTS = 600.0
"""Number of points at which the marker size reaches its minimum."""

_ACTIVE, _INACTIVE, _OBJECT = "#c0392b", "#b8c4cc", "#2c3e50"


def save_clouds(paths: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str]) -> None:
    """Draw the contact points of every object (columns) in every dataset (rows) to an image file, as thesis Figure 5.6.

    paths: grasp datasets. out: image file. The objects are those of the first dataset's grasps; only the first
    `MAX_OBJECTS` of them are drawn.
    """
    plt = _import_pyplot()
    datasets = [GraspDataset(path) for path in paths]
    try:
        names = list(dict.fromkeys(grasp.object for grasp in datasets[0]))
        names = [name for name in datasets[0].objects if name in names][:MAX_OBJECTS]
        figure = plt.figure(figsize=(4.2 * len(names), 4.3 * len(datasets) + 0.4), layout="constrained")
        for row, data in enumerate(datasets):
            for column, name in enumerate(names):
                axis = figure.add_subplot(len(datasets), len(names), row * len(names) + column + 1, projection="3d")
                points = accumulate(data, name).points
                grasps = sum(grasp.object == name for grasp in data)
                _draw_object(axis, data, name, np.eye(4))
                share = min(len(points) / MANY_POINTS, 1.0)  # few points need larger markers to be visible
                style = {"s": 12.0 - 10.0 * share, "alpha": 0.9 - 0.4 * share}
                axis.scatter(*(1e3 * points.T), c=_ACTIVE, linewidths=0, depthshade=False, **style)
                label = "real" if data.source == "real" else "simulated"
                axis.set_title(f"{name.replace('_', ' ')}, {label}\n{len(points)} points, {grasps} grasps", fontsize=10)
                _set_axes(axis, 1e3 * np.vstack([data.objects[name].vertices, points]))
        save_figure(figure, out, dpi=110)
        plt.close(figure)
    finally:
        for data in datasets:
            data.close()


def save_grasp(paths: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str], grasp_ids: Sequence[str]) -> None:
    """Draw one grasp of every dataset with active and inactive taxels to an image file, as Figure 5.3 of the thesis.

    paths: grasp datasets. out: image file. grasp_ids: the grasp of each dataset. Raises `DatasetError` if a dataset
    lacks its grasp.
    """
    plt = _import_pyplot()
    figure = plt.figure(figsize=(5.6 * len(paths), 5.6), layout="constrained")
    for column, (path, grasp_id) in enumerate(zip(paths, grasp_ids, strict=True)):
        with GraspDataset(path) as data:
            grasp = data[grasp_id]
            active, known = grasp.active_taxels(baseline_frames=max(count_baseline_frames(grasp), 1))
            points, used = 1e3 * locate_taxels(data, grasp), select_used_taxels(data)
            axis = figure.add_subplot(1, len(paths), column + 1, projection="3d")
            _draw_object(axis, data, grasp.object, np.eye(4))
            on = active & known
            axis.scatter(*points[~on].T, s=4.0, c=_INACTIVE, linewidths=0)
            axis.scatter(*points[on].T, s=16.0, c=_ACTIVE, linewidths=0)
            label = "real" if data.source == "real" else "simulated"
            grasp_name = f"{grasp.object.replace('_', ' ')}, {grasp.approach.replace('_', ' ')}"
            axis.set_title(
                f"{grasp_name}, {label}\n{int((on & used).sum())} active of {int(used.sum())} used taxels", fontsize=10
            )
            _set_axes(axis, np.vstack([points, 1e3 * data.objects[grasp.object].vertices]))
    save_figure(figure, out, dpi=110)
    plt.close(figure)


def _draw_object(axis: Any, data: GraspDataset, name: str, pose: FloatArray) -> None:
    """Draw the visible edges of the object `name` into a 3-D plot, in millimetres.

    pose: f64[4, 4] of the object in the plot, metres.
    """
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    mesh = data.objects[name]
    corners = 1e3 * apply(pose, mesh.vertices)
    axis.add_collection3d(
        Line3DCollection(corners[_select_drawn_edges(mesh.vertices, mesh.faces)], colors=_OBJECT, lw=0.8)
    )


def _select_drawn_edges(vertices: FloatArray, faces: NDArray[np.int32]) -> NDArray[np.intp]:
    """Select the edges of a mesh to draw: sharp edges, edges of only one face, and the silhouette as seen from `VIEW`.

    An edge is sharp if the normals of its two faces differ by more than 26 degrees (cosine 0.9). vertices: f64[v, 3].
    faces: vertex indices i32[f, 3]. Returns pairs of vertex indices intp[e, 2].
    """
    elevation, azimuth = np.radians(VIEW)
    towards = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
    normals = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    is_front = normals @ towards > 0.0
    faces_of_edge: dict[tuple[int, int], list[int]] = {}
    for index, face in enumerate(faces.tolist()):
        for a, b in ((0, 1), (1, 2), (2, 0)):
            faces_of_edge.setdefault((min(face[a], face[b]), max(face[a], face[b])), []).append(index)

    def is_drawn(adjacent: list[int]) -> bool:
        """Return whether an edge is drawn: of one face only, sharp (cosine below 0.9), or part of the silhouette.

        adjacent: indices of the faces that contain the edge.
        """
        if len(adjacent) != 2:
            return True
        first, second = adjacent
        return bool(normals[first] @ normals[second] < 0.9 or is_front[first] != is_front[second])

    edges = [edge for edge, adjacent in faces_of_edge.items() if is_drawn(adjacent)]
    return np.array(edges, dtype=np.intp).reshape(-1, 2)


def _set_axes(axis: Any, points: FloatArray) -> None:
    """Set equal scales, limits, view and labels of a 3-D plot. points: f64[n, 3] that must be visible, millimetres."""
    from matplotlib.ticker import MultipleLocator

    low, high = points.min(axis=0), points.max(axis=0)
    axis.set_xlim(low[0], high[0])
    axis.set_ylim(low[1], high[1])
    axis.set_zlim(low[2], high[2])
    axis.set_box_aspect(tuple(high - low), zoom=0.86)  # one scale for all axes; a larger zoom clips the labels
    axis.view_init(*VIEW)
    axis.grid(False)
    axis.tick_params(labelsize=6, pad=-2)
    for letter in "xyz":
        getattr(axis, f"{letter}axis").set_major_locator(MultipleLocator(TICK_MM))
        getattr(axis, f"set_{letter}label")(f"{letter} mm", fontsize=7, labelpad=-6)


def _import_pyplot() -> Any:
    """Import pyplot of Matplotlib with a backend that needs no display."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    return plt
