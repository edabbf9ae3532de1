"""Options and report that all imports have in common."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from taxel.grasp.objects import GraspObject, make_thesis_objects, select_object_sizes
from taxel.hand import Hand, load_hand
from taxel.sim.importers.csv_table import Progress, ignore_progress
from taxel.sim.sensor_model import SimSensor
from taxel.types import FloatArray

__all__ = ["ImportOptions", "ImportReport"]


@dataclass(frozen=True, eq=False)
class ImportOptions:
    """Common options of all imports into a grasp dataset.

    Attributes:
        objects: known shapes by name; empty: the test objects of the thesis, in the sizes that belong to the hand.
        object_poses: calibrated poses f64[4, 4] in the world by name of the object.
        wrist_pose: f64[4, 4], pose of the wrist link in the world, for files with the joint angles of the hand only.
        baseline_frames: required number of frames of the phase baseline; frames without contact are added before a
            grasp with fewer frames. None: a grasp without enough baseline frames is refused.
        sensor: sensor model that converts forces into counts. seed: of its noise.
        overwrite: replace an existing file.
        progress: called with the current step and its progress.
    """

    hand: Hand = field(default_factory=lambda: load_hand("original"))
    objects: Mapping[str, GraspObject] = field(default_factory=dict)
    object_poses: Mapping[str, FloatArray] = field(default_factory=dict)
    wrist_pose: FloatArray | None = None
    baseline_frames: int | None = None
    sensor: SimSensor = field(default_factory=SimSensor)
    seed: int = 1
    overwrite: bool = False
    progress: Progress = ignore_progress

    def __post_init__(self) -> None:
        """Complete the objects."""
        if not self.objects:
            object.__setattr__(self, "objects", make_thesis_objects(select_object_sizes(self.hand.robot)))


@dataclass
class ImportReport:
    """Numbers of imported items.

    grasps, frames: written to the dataset. added_frames: baseline frames among them that were added. contacts: contact
    points that were read. far_contacts: contact points that act on no taxel. far_force_n: sum of their forces, newtons.
    """

    grasps: int = 0
    frames: int = 0
    added_frames: int = 0
    contacts: int = 0
    far_contacts: int = 0
    far_force_n: float = 0.0
