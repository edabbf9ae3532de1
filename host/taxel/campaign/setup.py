"""What every campaign has in common: the hand on its robot, the objects and where they stand, the approaches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.calibration import Calibration
from taxel.grasp.objects import GraspObject, standing_pose, thesis_objects
from taxel.grasp.plan import PLACINGS, Approach, Placing, PlannedGrasp, thesis_approaches
from taxel.grasp.reach import ArmReach
from taxel.grasp.timeline import Timeline
from taxel.hand import Hand, load_hand
from taxel.hand.kinematics import Kinematics, kinematics_of
from taxel.hand.robot import Robot
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable

WRIST_LINK = "palm"

WITHDRAW_M = 0.02
"""How far the palm is away while the baseline is taken (assumed; the thesis takes it before the arm comes, 5.4)."""


@dataclass(frozen=True, eq=False)
class Setup:
    """A workstation.

    calibration: measured poses of objects in the robot's base and of brackets that were mounted again; what it does not
    tell is where it was planned. placings: how the hand meets the objects. Raises UnknownBoardError for a bracket of a
    board that the hand lacks.
    """

    hand: Hand = field(default_factory=lambda: load_hand("allegro"))
    objects: Mapping[str, GraspObject] = field(default_factory=thesis_objects)
    calibration: Calibration | None = None
    placings: Mapping[tuple[str, str], Placing] = field(default_factory=lambda: PLACINGS)

    def __post_init__(self) -> None:
        if self.calibration is not None:
            for name, estimate in self.calibration.brackets.items():
                board = replace(self.hand.board_named(name), pose=estimate.transform)
                boards = tuple(board if other.name == name else other for other in self.hand.boards)
                object.__setattr__(self, "hand", replace(self.hand, boards=boards))

    @cached_property
    def kinematics(self) -> Kinematics:
        """Of the whole robot with the hand's skin."""
        return kinematics_of(self.hand)

    @cached_property
    def wrist_robot(self) -> Robot:
        """The part of the robot that moves while the arm rests."""
        return self.kinematics.robot.below(WRIST_LINK)

    @cached_property
    def _approaches(self) -> dict[tuple[str, str], Approach]:
        approaches = thesis_approaches(withdraw_m=WITHDRAW_M, placings=self.placings)
        return {(approach.object, approach.name): approach for approach in approaches}

    @cached_property
    def _arms(self) -> dict[tuple[str, str], NDArray[np.float64]]:
        return {}

    def approach(self, planned: PlannedGrasp) -> Approach:
        """The approach of a planned grasp."""
        return self._approaches[planned.object, planned.approach]

    def object_pose(self, name: str) -> NDArray[np.float64]:
        """Where the experimenter believes an object to stand, f64[4, 4], world."""
        if self.calibration is not None and name in self.calibration.objects:
            return self.calibration.objects[name].transform
        return standing_pose()

    def arm_path(self, planned: PlannedGrasp) -> NDArray[np.float64]:
        """Joint angles of the arm at the object and withdrawn from it, f64[2, 6]; raises UnreachableError."""
        key = (planned.object, planned.approach)
        if key not in self._arms:
            reach = ArmReach(self.kinematics.robot, WRIST_LINK)
            approach, where = self.approach(planned), self.object_pose(planned.object)
            at = reach.solve(where @ approach.palm_pose_at(0.0))
            away = reach.solve(where @ approach.palm_pose_at(1.0), near=at)
            self._arms[key] = np.stack([at, away])
        return self._arms[key]

    def arm_angles(
        self, planned: PlannedGrasp, timeline: Timeline, times_s: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Joint angles of the arm at `times_s` [k] of the grasp, f64[k, 6]: it withdraws in joint space."""
        at, away = self.arm_path(planned)
        withdrawn = np.array([timeline.withdrawn_at(time) for time in times_s.tolist()])
        return np.asarray(at + withdrawn[:, None] * (away - at))

    def wrist_poses(self, arm: NDArray[np.float64]) -> NDArray[np.float64]:
        """The wrist link in the world for joint angles of the arm f64[k, 6], f64[k, 4, 4]."""
        robot = self.kinematics.robot
        angles = np.zeros((len(arm), len(robot.joint_names)))
        angles[:, : arm.shape[1]] = arm
        return np.asarray(self.kinematics.link_poses(angles)[:, robot.link_index(WRIST_LINK)])

    def taxel_table(self) -> TaxelTable:
        """The hand's taxels as a dataset has them."""
        hand = self.hand
        size = np.full(hand.n_taxels, hand.size_m)
        return TaxelTable(hand.sensor, hand.tx, hand.rx, hand.position, hand.normal, size)

    def sensor_table(self, rate_hz: float) -> SensorTable:
        """The hand's boards as a dataset has them, at a common rate."""
        boards = self.hand.boards
        return SensorTable(
            np.array([board.address for board in boards], np.uint8),
            tuple(board.name for board in boards),
            tuple(board.kind.name for board in boards),
            np.full(len(boards), rate_hz),
        )

    def meshes(self) -> dict[str, ObjectMesh]:
        """The objects as a dataset has them."""
        meshes = {name: item.shape.mesh() for name, item in self.objects.items()}
        return {name: ObjectMesh(vertices, faces.astype(np.int32)) for name, (vertices, faces) in meshes.items()}
