"""Contact points of the real and of the simulated side of the original experiment with a combination of effects."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from taxel.cloud.contacts import count_baseline_frames
from taxel.hand import Hand
from taxel.hand.transforms import inverse
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.thesis.own_gap.effects import OwnEffects
from taxel.thesis.own_gap.plugin import PluginGrasp, find_plugin_contacts
from taxel.thesis.own_gap.taxel_sets import TaxelSets, get_centres, place_in_object_frame, select_used
from taxel.types import BoolArray, FloatArray

Points = dict[str, FloatArray]
"""Contact points of all grasps, f64[N, 3], by name of the object: metres, in the nominal frame of the object."""


@dataclass(frozen=True, eq=False)
class MeasuredGrasp:
    """Signals of one grasp.

    Attributes:
        object: name of the grasped object.
        brackets: f64[s, 4, 4], poses of the brackets in the nominal frame of the object, metres.
        signal: f64[n], counts, baseline minus mean over hold; NaN without a valid frame.
    """

    object: str
    brackets: FloatArray
    signal: FloatArray


def read_measured_grasps(data: GraspDataset) -> list[MeasuredGrasp]:
    """Read the signals of all grasps of a dataset that have a baseline. Raises DatasetError."""
    grasps = []
    for grasp in data:
        if frames := count_baseline_frames(grasp):
            brackets = inverse(grasp.object_pose) @ grasp.sensor_pose
            grasps.append(MeasuredGrasp(grasp.object, brackets, grasp.mean_hold_signal(frames)))
    return grasps


def find_active(signal: FloatArray, used: BoolArray, *, with_rises: bool) -> BoolArray:
    """Find the active taxels, bool[n].

    signal: f64[n], counts; a taxel with NaN was not measured and is not active. used: bool[n]; other taxels are not
    active. with_rises: whether a raw count that changes by at least 150 counts in either direction activates a taxel,
    as in the original host; False: only a decrease by more than 150 counts.
    """
    known = np.nan_to_num(signal)
    is_active = np.abs(known) >= ACTIVE_SIGNAL_COUNTS if with_rises else known > ACTIVE_SIGNAL_COUNTS
    return np.asarray(used & is_active)


def collect_real_points(grasps: Sequence[MeasuredGrasp], sets: TaxelSets, effects: OwnEffects) -> Points:
    """Collect the contact points that the original host program of the hardware saves.

    grasps: measured signals. sets: properties of the taxels. effects: known errors of the program that are switched on.
    """
    used, centres = select_used(sets, effects, is_real=True), get_centres(sets, effects, is_real=True)
    active = [find_active(grasp.signal, used, with_rises=effects.rises) for grasp in grasps]
    return _collect([(grasp.object, grasp.brackets) for grasp in grasps], active, sets, centres)


def collect_layer_points(grasps: Sequence[MeasuredGrasp], sets: TaxelSets, effects: OwnEffects) -> Points:
    """Collect the contact points of a simulated campaign with an elastic layer.

    grasps: simulated signals. sets: properties of the taxels. effects: known errors of the original simulation that are
    switched on.
    """
    used, centres = select_used(sets, effects, is_real=False), get_centres(sets, effects, is_real=False)
    active = [find_active(grasp.signal, used, with_rises=False) for grasp in grasps]
    return _collect([(grasp.object, grasp.brackets) for grasp in grasps], active, sets, centres)


def collect_plugin_points(hand: Hand, grasps: Sequence[PluginGrasp], sets: TaxelSets, effects: OwnEffects) -> Points:
    """Collect the contact points that the contact plug-in of the original simulation saves.

    grasps: recorded contact messages. sets: properties of the taxels. effects: known errors of the plug-in that are
    switched on.
    """
    used, centres = select_used(sets, effects, is_real=False), get_centres(sets, effects, is_real=False)
    active = [found & used for found in find_plugin_contacts(hand, grasps, effects)]
    poses = [(grasp.object, inverse(grasp.object_pose) @ grasp.sensor_pose) for grasp in grasps]
    return _collect(poses, active, sets, centres)


def _collect(
    poses: Sequence[tuple[str, FloatArray]], active: Sequence[BoolArray], sets: TaxelSets, centres: FloatArray
) -> Points:
    """Collect the centres of the active taxels of all grasps by object, in the frame of the object.

    poses: name of the object, and poses of the brackets in its frame, f64[s, 4, 4], for each grasp. active: active
    taxels, bool[n], for each grasp. centres: f64[n, 3], metres, bracket frame.
    """
    points: dict[str, list[FloatArray]] = {}
    for (name, brackets), is_active in zip(poses, active, strict=True):
        placed = place_in_object_frame(sets, centres, brackets)
        points.setdefault(name, []).append(placed[is_active])
    return {name: np.concatenate(parts) for name, parts in points.items()}
