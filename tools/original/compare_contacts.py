"""Compare the contacts of two recorded closings of the original simulator with the mode `original` of this project.

    python tools/original/compare_contacts.py [--json]

Inputs: tools/hand/original/simulated_contacts_*.csv, raw contact points and kept taxel centres of two closings without
an arm. The tool recovers the pose of hand and object from these points, applies the rule of the contact plug-in to the
recorded points, and simulates the same objects and poses with MuJoCo: in the recovered posture, and closing with the
torques of the original. Outputs: the tables of docs/original-simulator.md.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).parents[1] / "hand"))
from original_robot import JOINT_NAMES, map_to_palm
from recorded_closings import FINGERS, Closing, count_kept, recover, select_recorded

from taxel.grasp.plan import Approach
from taxel.grasp.timeline import Timeline
from taxel.hand import load_hand
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import load_robot
from taxel.hand.transforms import apply, inverse, to_quaternion
from taxel.sim.closing import SimulationSettings, simulate_grasp
from taxel.sim.contact_messages import ContactMessage, MessageRecorder
from taxel.sim.original_sensing import (
    PALM_TIPS_M,
    THRESHOLD_HISTORY_M,
    ContactMemory,
    OriginalRules,
    StoredPoints,
    find_active,
    get_centres,
    get_surface_heights,
    make_recorder_settings,
)
from taxel.sim.scene import Scene, build_scene
from taxel.types import FloatArray, IndexArray

TORQUE_NM: Final = 0.52
"""Torque of the finger joints of the original simulation, Nm."""

TIPS_M: Final = {"cylinder": 0.0, "box": PALM_TIPS_M}
"""Height of the tips of the palm during the closing, metres (inferred): the cylinder lies up to 0.9 mm below the plane
of the pads, the face of the box 0.5 mm above it.
"""

Active = dict[str, set[int]]
"""Indices of the active taxels by threshold, mm."""


@dataclass(frozen=True)
class Row:
    """Figures of one set of contact points on the object.

    points, distinct: number of points, with and without repetitions. extent_mm: smallest and largest coordinate of each
    axis. distance_mm: median, 95 % quantile and maximum of the distance to the object's surface. nearest_mm: median
    distance to the nearest recorded point, and of the recorded points to the nearest of these points. active: number of
    taxels that the plug-in's rule activates, by threshold in mm. common: how many of them the recorded points activate,
    too.
    """

    source: str
    points: int
    distinct: int
    extent_mm: tuple[tuple[float, float], ...]
    distance_mm: tuple[float, float, float]
    nearest_mm: tuple[float, float]
    active: dict[str, int]
    common: dict[str, int]


def count_by_rule(closing: Closing) -> dict[str, int]:
    """Return how many taxels the recorded contact points activate, by threshold and kind of taxel centres.

    By the rule of the original contact plug-in, a contact point activates the taxels whose centres are nearer than a
    threshold. A key contains the threshold in mm and the centres: "coded" (in the original code) or "true".
    """
    scene, palm, angles = make_scene(closing, OriginalRules())
    sensors = compute_sensor_poses(scene, palm, angles)
    numbers = {}
    for coded in (True, False):
        names = ("half_diagonal", "final", "winter_2022")
        for threshold, taxels in activate(select_recorded(closing), None, sensors, names, coded).items():
            numbers[f"{threshold} {'coded' if coded else 'true'}"] = len(taxels)
    return numbers


def compute_sensor_poses(scene: Scene, palm: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the poses f64[s, 4, 4] of the s brackets in the world.

    palm: f64[4, 4], pose of the palm in the world. angles: joint angles in radians.
    """
    robot = load_robot("ur5e_original").get_subtree("palm")
    return np.asarray(palm @ Kinematics(robot, scene.hand).compute_sensor_poses(angles))


def make_scene(closing: Closing, rules: OriginalRules) -> tuple[Scene, FloatArray, FloatArray]:
    """Create the scene of a recorded closing.

    Returns the scene, the palm's pose in the world f64[4, 4], and the recovered joint angles in radians.
    """
    hand = load_hand("original")
    scene = build_scene(hand, closing.item, "palm", layer_m=get_surface_heights(hand, rules))
    palm = closing.palm_link @ inverse(map_to_palm(np.eye(4)))
    angles = np.array([closing.angles.get(JOINT_NAMES[name], 0.0) for name in scene.joint_names])
    return scene, palm, angles


def describe(source: str, closing: Closing, points: FloatArray, active: Active, reference: Active) -> Row:
    """Return the figures of contact points f64[c, 3] of a closing.

    source: name of the points. active, reference: taxels that these points, and the recorded points, activate.
    """
    distance = 1e3 * np.abs(closing.item.shape.signed_distance(apply(inverse(closing.object_pose), points)))
    low, high = 1e3 * points.min(axis=0), 1e3 * points.max(axis=0)
    recorded = select_recorded(closing)
    to_recorded = np.asarray(cKDTree(recorded).query(points)[0])
    from_recorded = np.asarray(cKDTree(points).query(recorded)[0])
    return Row(
        source,
        len(points),
        len(np.unique(points.round(6), axis=0)),
        tuple(zip(low.tolist(), high.tolist(), strict=True)),
        (float(np.median(distance)), float(np.quantile(distance, 0.95)), float(distance.max())),
        (1e3 * float(np.median(to_recorded)), 1e3 * float(np.median(from_recorded))),
        {name: len(taxels) for name, taxels in active.items()},
        {name: len(taxels & reference[name]) for name, taxels in active.items()},
    )


def activate(
    points: FloatArray,
    board_of_point: IndexArray | None,
    sensors: FloatArray,
    thresholds: Sequence[str] = ("final", "winter_2022"),
    coded: bool = True,
) -> Active:
    """Return the indices of the active taxels by threshold (a text in mm).

    By the rule of the original contact plug-in, a taxel is active if a contact point is nearer to its centre than the
    threshold. points: f64[c, 3] in the world. board_of_point: board that keeps each point; None: every board. sensors:
    f64[s, 4, 4], brackets in the world. thresholds: names in `THRESHOLD_HISTORY_M`. coded: use the centres in the
    original code instead of the true ones.
    """
    hand, active = load_hand("original"), {}
    for name in thresholds:
        rules = OriginalRules(threshold_m=THRESHOLD_HISTORY_M[name], coded_centres=coded)
        centres, taxels = get_centres(hand, rules), set[int]()
        for index, board in enumerate(hand.boards):
            own = points if board_of_point is None else points[board_of_point == index]
            where = hand.get_slice(board.address)
            placed = apply(sensors[index], centres[where])
            near, _ = find_active(placed, StoredPoints(own, np.ones(len(own))), rules.threshold_m)
            taxels |= {where.start + int(taxel) for taxel in np.flatnonzero(near)}
        active[f"{1e3 * rules.threshold_m:.2f}"] = taxels
    return active


def compare(name: str) -> tuple[Closing, list[Row]]:
    """Return the recovered closing `name` and the figures of its contact points.

    There is one row of figures for the recorded contact points, one for the contact points of MuJoCo in the recovered
    posture, and one for the contact points of a closing that MuJoCo simulates.
    """
    closing, rules = recover(name), replace(OriginalRules(), palm_tips_m=TIPS_M[name])
    scene, palm, angles = make_scene(closing, rules)
    sensors = compute_sensor_poses(scene, palm, angles)
    reference = activate(select_recorded(closing), None, sensors)
    rows = [describe("recorded", closing, select_recorded(closing), reference, reference)]

    data = mujoco.MjData(scene.model)
    scene.place_object(data, closing.object_pose)
    index = scene.model.body_mocapid[scene.link_bodies[0]]
    data.mocap_pos[index], data.mocap_quat[index] = palm[:3, 3], to_quaternion(palm)
    data.qpos[scene.joint_addresses] = angles
    mujoco.mj_forward(scene.model, data)
    recorder = MessageRecorder(scene, make_recorder_settings(scene.hand, rules))
    recorder.observe(data, 0.1)
    recorder.send()
    rows.append(_describe_messages("MuJoCo, recovered posture", closing, recorder.messages, sensors, reference))

    # The thumb and the first joint of each finger keep their recorded angles; a torque closes the other joints.
    is_fixed = np.array([joint.endswith("_j0") or joint.startswith("th") for joint in scene.joint_names])
    approach = Approach(
        name,
        "bar",
        inverse(closing.object_pose) @ palm,
        np.where(is_fixed, angles, 0.0),
        np.where(is_fixed, angles, np.nan),
        np.where(is_fixed, 0.0, TORQUE_NM),
    )
    # Timeline below: 3 s of closing and 1 s of hold, without the other phases.
    settings = SimulationSettings(
        object_pose=closing.object_pose, recorder=make_recorder_settings(scene.hand, rules), holds_object=True
    )
    motion = simulate_grasp(scene, approach, Timeline(0.0, 3.0, 1.0, 0.0, 0.0), settings)
    assert motion.messages is not None
    end = replace(closing, object_pose=motion.object_pose[-1])
    rows.append(_describe_messages("MuJoCo, closing", end, motion.messages, motion.sensor_poses[-1], reference))
    return closing, rows


def _describe_messages(
    source: str, closing: Closing, messages: Iterable[ContactMessage], sensors: FloatArray, reference: Active
) -> Row:
    """Return the figures of the contact points that the boards keep after all contact messages of a closing.

    source: name of the points in the result. sensors: f64[s, 4, 4], brackets in the world. reference: taxels that the
    recorded contact points activate.
    """
    memory = ContactMemory(OriginalRules())
    for message in messages:
        memory.receive(message)
    stored = [memory.get_points(index).position for index in range(len(sensors))]
    board = np.repeat(np.arange(len(stored)), [len(one) for one in stored])
    points = np.concatenate(stored)
    return describe(source, closing, points, activate(points, board, sensors), reference)


def format_closing(closing: Closing, rows: Sequence[Row]) -> str:
    """Return the comparison of one closing as text with a Markdown table."""
    kept, own = count_kept(closing)
    y, z = 1e3 * closing.object_pose[1:3, 3]
    residual = ", ".join(f"{part} {value:.4f}" for part, value in closing.residual_mm.items())
    with_true = recover(closing.name, False).residual_mm
    true_residual = ", ".join(f"{finger} {with_true[finger]:.2f}" for finger in FINGERS)
    by_rule = ", ".join(f"{key} {number}" for key, number in count_by_rule(closing).items())
    lines = [
        f"{closing.name}: palm_link {1e3 * closing.palm_link[2, 3]:.3f} mm above the ground, axis at y = {y:.2f}, "
        f"z = {z:.2f} mm",
        f"residual of the taxel centres, mm: {residual}",
        f"residual with the true centres, mm: {true_residual}",
        f"taxels within 5 mm of a raw contact: kept by the original {kept}, found here {own}",
        f"active taxels of the recorded points, by threshold (mm) and centres: {by_rule}",
        "",
        "| contact points | number | distinct | x, y, z, mm | to the surface, mm | to the other cloud, mm "
        "| active at 2.34 mm | at 5.12 mm |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        extent = ", ".join(f"{low:.1f} to {high:.1f}" for low, high in row.extent_mm)
        distances = " / ".join(f"{value:.2f}" for value in row.distance_mm)
        nearest = "-" if row.source == "recorded" else " / ".join(f"{value:.1f}" for value in row.nearest_mm)
        active = " | ".join(
            f"{number}" if row.source == "recorded" else f"{number} ({row.common[name]} common)"
            for name, number in row.active.items()
        )
        lines.append(
            f"| {row.source} | {row.points} | {row.distinct} | {extent} | {distances} | {nearest} | {active} |"
        )
    return "\n".join(lines)


def main() -> int:
    """Print the comparison of both recorded closings."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="one JSON document instead of text")
    as_json = parser.parse_args().json
    document = {}
    for name in ("cylinder", "box"):
        closing, rows = compare(name)
        if as_json:
            kept, own = count_kept(closing)
            document[name] = {
                "palm_link_z_mm": 1e3 * float(closing.palm_link[2, 3]),
                "angles_rad": closing.angles,
                "residual_mm": closing.residual_mm,
                "kept_by_the_original_filter": kept,
                "kept_here": own,
                "rows": [asdict(row) for row in rows],
            }
        else:
            print(format_closing(closing, rows) + "\n")
    if as_json:
        print(json.dumps(document, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
