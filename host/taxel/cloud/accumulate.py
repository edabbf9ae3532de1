"""Contact cloud of one object of a grasp dataset: the active taxels of all its grasps in the object's frame."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.contacts import count_baseline_frames, locate_taxels, select_used_taxels
from taxel.cloud.errors import CloudError
from taxel.cloud.propagation import Propagation
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class _GraspContacts:
    """State of all n taxels in one grasp.

    positions: f64[n, 3], taxel centres in the frame of the object, metres. signal_counts: f64[n]. active, inactive:
    bool[n]; both are False for a taxel without a valid measurement.
    """

    grasp: Grasp
    positions: FloatArray
    signal_counts: FloatArray
    active: BoolArray
    inactive: BoolArray


def accumulate(
    data: GraspDataset,
    object_name: str,
    threshold: float = ACTIVE_SIGNAL_COUNTS,
    *,
    propagation: Propagation | None = None,
    taxels: BoolArray | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> ContactCloud:
    """Accumulate the contact points of all grasps of an object, in the nominal frame of the object, metres.

    The cloud has one point for each grasp and taxel whose signal (mean over hold) exceeds `threshold` counts. A taxel
    without a valid hold frame is neither an active nor an inactive point. A grasp without a baseline is left out.

    propagation: contact propagation to apply, as in the thesis for simulated clouds; None: no propagation. taxels:
    taxels that are used, bool[n]; None: those of the thesis (section 5.2). progress: called with the number of grasps
    read and their total number. Raises CloudError for an object that the dataset does not contain, DatasetError for a
    damaged dataset.
    """
    if object_name not in data.objects:
        names = ", ".join(data.objects) or "none"
        raise CloudError(str(data.path), "object", f"one of {names}", object_name, "correct the name")
    used = select_used_taxels(data) if taxels is None else taxels
    contacts = list(_contacts_by_grasp(data, object_name, threshold, propagation, used, progress))
    approaches = tuple(sorted({item.grasp.approach for item in contacts}))
    active_rows = [np.full(int(item.active.sum()), row) for row, item in enumerate(contacts)]
    inactive_rows = [np.full(int(item.inactive.sum()), row) for row, item in enumerate(contacts)]
    return ContactCloud(
        f"{data.path}, {object_name}",
        np.concatenate([np.empty((0, 3)), *(item.positions[item.active] for item in contacts)]),
        np.concatenate([np.empty(0), *(item.signal_counts[item.active] for item in contacts)]),
        np.concatenate([np.empty(0, np.int64), *active_rows]),
        np.concatenate([np.empty(0, np.int64), *(np.flatnonzero(item.active) for item in contacts)]),
        tuple(item.grasp.id for item in contacts),
        np.array([approaches.index(item.grasp.approach) for item in contacts], np.int64),
        approaches,
        np.concatenate([np.empty((0, 3)), *(item.positions[item.inactive] for item in contacts)]),
        np.concatenate([np.empty(0, np.int64), *inactive_rows]),
    )


def _contacts_by_grasp(
    data: GraspDataset,
    object_name: str,
    threshold: float,
    propagation: Propagation | None,
    used: BoolArray,
    progress: Callable[[int, int], None],
) -> Iterator[_GraspContacts]:
    """Yield the active and inactive taxels of each grasp of an object that has a baseline, in dataset order.

    threshold: signal in counts above which a taxel is active. used: bool[n]; the other taxels are neither active nor
    inactive.
    """
    neighbours = propagation.find_neighbours(data.taxels) if propagation else None
    grasps = [grasp for grasp in data if grasp.object == object_name]
    for done, grasp in enumerate(grasps, 1):
        if frames := count_baseline_frames(grasp):
            signal = grasp.mean_hold_signal(frames)
            measured = used & ~np.isnan(signal)
            active: BoolArray = measured & (np.where(measured, signal, 0.0) > threshold)
            if propagation is not None and neighbours is not None:
                reached, signal = propagation.apply(active, signal, neighbours)
                active = reached & measured
            yield _GraspContacts(grasp, locate_taxels(data, grasp), signal, active, measured & ~active)
        progress(done, len(grasps))
