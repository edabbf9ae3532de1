"""The workstation of a campaign: the hand on its robot, the objects and their poses, the approaches."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.calibration import Calibration
from taxel.grasp.objects import (
    ORIGINAL_ROBOT,
    GraspObject,
    make_standing_pose,
    make_thesis_objects,
    select_object_sizes,
)
from taxel.grasp.original_plan import Setting, get_original_object_pose, make_original_approaches, set_finger_bases
from taxel.grasp.plan import PALM_PLACEMENTS, Approach, PalmPlacement, PlannedGrasp, make_thesis_approaches
from taxel.grasp.reach import ArmReach
from taxel.grasp.timeline import Timeline
from taxel.hand import Hand, load_hand
from taxel.hand.kinematics import Kinematics, build_kinematics
from taxel.hand.robot import Robot
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable

WRIST_LINK = "palm"

ORIGINAL_TABLE_Z_M = 0.02475
"""Height of the original table's surface over the frame of the arm's base, metres. Source: the published descriptions
(table top at 1017.5 mm, base at 992.75 mm).
"""

WITHDRAW_M = 0.02
"""Distance of the palm while the baseline is recorded (assumed; the thesis records it before the arm moves in, 5.4)."""


@dataclass(frozen=True, eq=False)
class Setup:
    """Hand, objects and poses of a grasp campaign.

    objects: by name; empty: the three test objects, in the assumed sizes for the assumed hand, in the original sizes
    for any other hand. calibration: measured poses of objects in the frame of the robot's base, and of remounted
    brackets; objects and brackets without an entry are at their planned poses. placements: pose of the palm against the
    object, by object and approach; empty: the poses of the original experiment for the original hand, `PALM_PLACEMENTS`
    for any other. setting: whether the original hand uses the palm poses of the original "hardware" or "simulation".
    torques: the same choice for the finger torques; the hardware limits those of medial and distal joints. Raises
    UnknownBoardError for a bracket of a board that the hand lacks.
    """

    hand: Hand = field(default_factory=lambda: load_hand("original"))
    objects: Mapping[str, GraspObject] = field(default_factory=dict)
    calibration: Calibration | None = None
    placements: Mapping[tuple[str, str], PalmPlacement] = field(default_factory=dict)
    setting: Setting = "simulation"
    torques: Setting = "hardware"

    def __post_init__(self) -> None:
        """Set the default objects if none are given, and replace bracket poses of the hand by calibrated poses."""
        if not self.objects:
            object.__setattr__(self, "objects", make_thesis_objects(select_object_sizes(self.hand.robot)))
        if self.calibration is not None:
            for name, estimate in self.calibration.brackets.items():
                board = replace(self.hand.find_board(name), pose=estimate.transform)
                boards = tuple(board if other.name == name else other for other in self.hand.boards)
                object.__setattr__(self, "hand", replace(self.hand, boards=boards))

    @property
    def is_original(self) -> bool:
        """Whether the hand is mounted as in the original experiment, so that the grasps of that experiment apply."""
        return self.hand.robot == ORIGINAL_ROBOT

    @property
    def table_z_m(self) -> float:
        """Height of the table in the frame of the robot's base, metres; the assumed table is level with the base."""
        return ORIGINAL_TABLE_Z_M if self.is_original else 0.0

    @cached_property
    def kinematics(self) -> Kinematics:
        """Forward kinematics of the whole robot, with the poses of the hand's boards."""
        return build_kinematics(self.hand)

    @cached_property
    def wrist_robot(self) -> Robot:
        """The part of the robot below the wrist: the hand, which moves while the arm is at rest."""
        return self.kinematics.robot.get_subtree(WRIST_LINK)

    @cached_property
    def _approaches(self) -> dict[tuple[str, str], Approach]:
        """The approaches of the thesis by names of object and approach."""
        if self.is_original and not self.placements:
            return make_original_approaches(WITHDRAW_M, self.setting, self.torques)
        placements = self.placements or PALM_PLACEMENTS
        approaches = make_thesis_approaches(WITHDRAW_M, placements, self.objects, self.hand)
        return {(approach.object, approach.name): approach for approach in approaches}

    @cached_property
    def _arms(self) -> dict[tuple[str, str], NDArray[np.float64]]:
        """Cache of solved arm angles, f64[2, 6] radians, by names of object and approach."""
        return {}

    def approach(self, planned: PlannedGrasp) -> Approach:
        """Return the approach (pose of the palm, joint angles, torques) of a planned grasp.

        For the original hand, the first joint of each finger has the angle measured in the grasp's iteration.
        """
        approach = self._approaches[planned.object, planned.approach]
        if self.is_original and not self.placements:
            return set_finger_bases(approach, planned.iteration)
        return approach

    def approaches_to(self, name: str) -> dict[str, Approach]:
        """Return all approaches to the object `name`, by the approach's name.

        For the original hand, the first joint of each finger has its mean angle over all iterations.
        """
        return {approach: item for (target, approach), item in self._approaches.items() if target == name}

    def object_pose(self, name: str) -> NDArray[np.float64]:
        """Return the nominal pose f64[4, 4] of the object `name`, world: calibrated, or else as planned."""
        if self.calibration is not None and name in self.calibration.objects:
            return self.calibration.objects[name].transform
        return get_original_object_pose() if self.is_original else make_standing_pose()

    def arm_path(self, planned: PlannedGrasp) -> NDArray[np.float64]:
        """Solve for the arm's joint angles at the object (first) and withdrawn from it (second), f64[2, 6] radians.

        Results are cached. Raises UnreachableError if the arm cannot reach one of the two poses.
        """
        key = (planned.object, planned.approach)
        if key not in self._arms:
            reach = ArmReach(self.kinematics.robot, WRIST_LINK)
            approach, object_pose = self.approach(planned), self.object_pose(planned.object)
            grasping = reach.solve(object_pose @ approach.compute_palm_pose_at(0.0))
            withdrawn = reach.solve(object_pose @ approach.compute_palm_pose_at(1.0), near=grasping)
            self._arms[key] = np.stack([grasping, withdrawn])
        return self._arms[key]

    def arm_angles(
        self, planned: PlannedGrasp, timeline: Timeline, times_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Compute the joint angles of the arm f64[k, 6], radians, at k times f64[k], seconds since the grasp's start.

        Between the pose at the object and the withdrawn pose the angles are interpolated linearly. Raises
        UnreachableError.
        """
        grasping, withdrawn = self.arm_path(planned)
        share = np.array([timeline.get_withdrawal(time) for time in times_s.tolist()])
        return np.asarray(grasping + share[:, None] * (withdrawn - grasping))

    def wrist_poses(self, arm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the poses f64[k, 4, 4] of the wrist in the world, for joint angles of the arm f64[k, 6], radians."""
        robot = self.kinematics.robot
        angles = np.zeros((len(arm), len(robot.joint_names)))
        angles[:, : arm.shape[1]] = arm
        return np.asarray(self.kinematics.compute_link_poses(angles)[:, robot.get_link_index(WRIST_LINK)])

    def taxel_table(self) -> TaxelTable:
        """Make the dataset's table of taxels: board, lines, position, normal and size of each taxel of the hand."""
        hand = self.hand
        size = np.full(hand.n_taxels, hand.size_m)
        return TaxelTable(hand.sensor, hand.tx, hand.rx, hand.position, hand.normal, size)

    def sensor_table(self, rate_hz: float) -> SensorTable:
        """Make the dataset's table of boards: address, name, board kind and frame rate.

        rate_hz: frames per second of every board.
        """
        boards = self.hand.boards
        return SensorTable(
            np.array([board.address for board in boards], np.uint8),
            tuple(board.name for board in boards),
            tuple(board.kind.name for board in boards),
            np.full(len(boards), rate_hz),
        )

    def meshes(self) -> dict[str, ObjectMesh]:
        """Make the triangle meshes of the grasped objects for the dataset, by name."""
        meshes = {name: item.shape.mesh() for name, item in self.objects.items()}
        return {name: ObjectMesh(vertices, faces.astype(np.int32)) for name, (vertices, faces) in meshes.items()}
