"""What all imports have in common: the hand, the objects and where they stand, the sensor, the baseline."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from taxel.grasp.objects import GraspObject, make_thesis_objects
from taxel.hand import Hand, load_hand
from taxel.sim.importers.csv_table import Progress, silent
from taxel.sim.sensor_model import SimSensor
from taxel.types import FloatArray

__all__ = ["ImportOptions", "ImportReport"]


@dataclass(frozen=True, eq=False)
class ImportOptions:
    """Common options.

    objects: known shapes by name. object_poses: f64[4, 4] in the world by name of the object, as measured.
    wrist: f64[4, 4], the wrist link in the world, for joint angles of the hand alone. baseline_frames: frames without
    contact are added before a grasp that has fewer of phase 0; None: such a grasp is refused. sensor, seed: how force
    becomes counts, and its noise. overwrite: replace a file that exists. progress: told how far the import is.
    """

    hand: Hand = field(default_factory=lambda: load_hand("allegro"))
    objects: Mapping[str, GraspObject] = field(default_factory=make_thesis_objects)
    object_poses: Mapping[str, FloatArray] = field(default_factory=dict)
    wrist: FloatArray | None = None
    baseline_frames: int | None = None
    sensor: SimSensor = field(default_factory=SimSensor)
    seed: int = 1
    overwrite: bool = False
    progress: Progress = silent


@dataclass
class ImportReport:
    """What was imported.

    grasps, frames: written; added_frames of these are baseline frames that no file held. contacts: contact points
    read. far_contacts: those that no taxel feels, and far_force_n the sum of their forces, newtons.
    """

    grasps: int = 0
    frames: int = 0
    added_frames: int = 0
    contacts: int = 0
    far_contacts: int = 0
    far_force_n: float = 0.0
