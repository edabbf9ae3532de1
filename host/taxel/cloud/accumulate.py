"""From a grasp dataset to the contact cloud of one object: active taxels of all its grasps in the object's frame."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.contacts import baseline_frames, taxel_points, used_taxels
from taxel.cloud.errors import CloudError
from taxel.cloud.propagation import Propagation
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class _Felt:
    """One grasp: where the taxels are, f64[n, 3], what they told, f64[n], which were active, which not: bool[n]."""

    grasp: Grasp
    places: FloatArray
    signal_counts: FloatArray
    active: BoolArray
    quiet: BoolArray


def accumulate(
    data: GraspDataset,
    object_name: str,
    threshold: float = ACTIVE_SIGNAL_COUNTS,
    *,
    propagation: Propagation | None = None,
    taxels: BoolArray | None = None,
    show: Callable[[int, int], None] = lambda done, total: None,
) -> ContactCloud:
    """The contact cloud of an object, in the object's nominal frame, metres.

    A point for each grasp and taxel whose signal, the mean over hold, exceeds `threshold` counts, strictly. A taxel
    without a valid hold frame is in neither `points` nor `quiet`; a grasp without a baseline is left out.

    propagation: what the thesis adds to simulated clouds; None: nothing. taxels: which count, bool[n]; None: those of
    the thesis (5.2). show: told grasps read, and of how many.
    Raises CloudError for an object that the dataset lacks, DatasetError for a damaged dataset.
    """
    if object_name not in data.objects:
        known = ", ".join(data.objects) or "none"
        raise CloudError(str(data.path), "object", f"one of {known}", object_name, "correct the name")
    counting = used_taxels(data) if taxels is None else taxels
    felt = list(_felt(data, object_name, threshold, propagation, counting, show))
    approaches = tuple(sorted({one.grasp.approach for one in felt}))
    rows = [np.full(int(one.active.sum()), row) for row, one in enumerate(felt)]
    quiet_rows = [np.full(int(one.quiet.sum()), row) for row, one in enumerate(felt)]
    return ContactCloud(
        f"{data.path}, {object_name}",
        np.concatenate([np.empty((0, 3)), *(one.places[one.active] for one in felt)]),
        np.concatenate([np.empty(0), *(one.signal_counts[one.active] for one in felt)]),
        np.concatenate([np.empty(0, np.int64), *rows]),
        np.concatenate([np.empty(0, np.int64), *(np.flatnonzero(one.active) for one in felt)]),
        tuple(one.grasp.id for one in felt),
        np.array([approaches.index(one.grasp.approach) for one in felt], np.int64),
        approaches,
        np.concatenate([np.empty((0, 3)), *(one.places[one.quiet] for one in felt)]),
        np.concatenate([np.empty(0, np.int64), *quiet_rows]),
    )


def _felt(
    data: GraspDataset,
    object_name: str,
    threshold: float,
    propagation: Propagation | None,
    counting: BoolArray,
    show: Callable[[int, int], None],
) -> Iterator[_Felt]:
    """The grasps of an object that have a baseline, in order of time."""
    near = propagation.neighbours(data.taxels) if propagation else None
    grasps = [grasp for grasp in data if grasp.object == object_name]
    for done, grasp in enumerate(grasps, 1):
        if frames := baseline_frames(grasp):
            signal = grasp.mean_hold_signal(frames)
            known = counting & ~np.isnan(signal)
            active: BoolArray = known & (np.where(known, signal, 0.0) > threshold)
            if propagation is not None and near is not None:
                reached, signal = propagation.applied(active, signal, near)
                active = reached & known
            yield _Felt(grasp, taxel_points(data, grasp), signal, active, known & ~active)
        show(done, len(grasps))
