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
from functools import lru_cache
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).parents[1] / "hand"))
from original_figures import compute_frames, read_coded_centres, read_rows, read_taxels
from original_robot import JOINT_NAMES, map_to_palm

from taxel.grasp.objects import GraspObject
from taxel.grasp.plan import Approach
from taxel.grasp.shapes import ConvexPolytope, Cylinder
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

BOX_SIDE_M: Final = 0.040
"""Side of the box of these closings, metres: 51.9 to 91.9 mm and 74.2 to 114.2 mm in the contact points. The final box
is 60 mm by 35 mm.
"""

RADIUS_M: Final = 0.020
"""Radius of the cylinder, metres; a fit of the radius to the contact points gives 19.9 mm."""

BAR_LENGTH_M: Final = 0.201
"""Length of the two bars, metres: that of the meshes of the Gazebo models at that time. Only 116 mm of it are visible
in the contact points.
"""

BAR_START_M: Final = -0.071
"""Coordinate of the bar's end along the world's x axis, metres: its other end lies at the end of its support (130 mm).
"""

TORQUE_NM: Final = 0.52
"""Torque of the finger joints of the original simulation, Nm."""

FILTER_M: Final = 0.005
"""Distance of the original filter of the recorded closings: taxels within 5 mm of a raw contact were kept, metres."""

GROUND_M: Final = 0.01
"""Contact points below this height belong to the ground, the support of the bar or the thumb's tip on the ground."""

KINDS: Final = {"ft": "fingertip", "mf": "medial_front", "pf": "proximal_front"}
FINGERS: Final = {
    "index": ("i", 0, (-0.06, -0.03)),
    "middle": ("m", 4, (-0.02, 0.02)),
    "pinkie": ("p", 8, (0.025, 0.06)),
}
"""Prefix of the boards, number of the first joint, and range of the taxels along the world's x axis, metres."""

TIPS_M: Final = {"cylinder": 0.0, "box": PALM_TIPS_M}
"""Height of the tips of the palm during the closing, metres (inferred): the cylinder lies up to 0.9 mm below the plane
of the pads, the face of the box 0.5 mm above it.
"""

STARTS: Final = {"cylinder": (0.0, 1.49, 1.03, 1.35), "box": (0.0, 1.5, 0.63, 1.75)}
"""First guess of the joint angles of every finger, radians."""


Active = dict[str, set[int]]
"""Indices of the active taxels by threshold, mm."""


@dataclass(frozen=True, eq=False)
class Closing:
    """One recorded closing, in the world of the original: metres, radians.

    raw: f64[c, 3], contact points. kept: f64[k, 3], taxel centres within `FILTER_M` of one. item: the object.
    object_pose, palm_link: f64[4, 4]. angles: by original joint name. residual_mm: of the kept taxel centres by part.
    """

    name: str
    raw: FloatArray
    kept: FloatArray
    item: GraspObject
    object_pose: FloatArray
    palm_link: FloatArray
    angles: dict[str, float]
    residual_mm: dict[str, float]


@dataclass(frozen=True)
class Row:
    """Figures of one set of contact points on the object.

    points, distinct: number of points, and without repetitions. extent_mm: smallest and largest coordinates.
    distance_mm: median, 95 % quantile and maximum of the distance to the surface of the object. nearest_mm: median
    distance to the nearest recorded point, and from a recorded point to the nearest of these. active: number of taxels
    that the rule of the plug-in activates, by threshold in mm. common: number of them that the recorded points activate
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


def read_points(name: str) -> FloatArray:
    """Points of tools/hand/original/NAME.csv, f64[c, 3], metres."""
    return np.array([[float(row[f"{axis}_m"]) for axis in "xyz"] for row in read_rows(name)])


def place_finger(palm_link: FloatArray, finger: str, angles: FloatArray, coded: bool = True) -> FloatArray:
    """Taxel centres of the front boards of a finger in the world, f64[n, 3], metres. coded: else the true centres."""
    prefix, first, _ = FINGERS[finger]
    frames = compute_frames({f"joint_{first + i}_0": float(angle) for i, angle in enumerate(angles.tolist())})
    parts = []
    for short, kind in KINDS.items():
        centres = read_coded_centres(kind) if coded else read_taxels(kind)[:, :3]
        assert centres is not None
        parts.append(apply(palm_link @ frames[f"{prefix}{short}_bracket"], centres))
    return np.concatenate(parts)


def fit_finger(
    palm_link: FloatArray, finger: str, points: FloatArray, start: Sequence[float], coded: bool = True
) -> tuple[FloatArray, float]:
    """Joint angles f64[4], radians, at which taxel centres coincide with `points`, and the largest distance, metres.

    coded: coded centres, else true centres.
    """
    rng = np.random.default_rng(0)
    best, smallest = np.zeros(4), np.inf
    for _ in range(60):
        angles = np.asarray(start) + rng.normal(size=4) * (0.05, 0.08, 0.12, 0.12)
        for _ in range(25):
            nearest = np.asarray(cKDTree(place_finger(palm_link, finger, angles, coded)).query(points)[1])

            def compute_residual(values: FloatArray, nearest: IndexArray = nearest) -> FloatArray:
                """Differences of the nearest centres from the points, f64[3 k], metres."""
                return np.asarray((place_finger(palm_link, finger, values, coded)[nearest] - points).ravel())

            found = least_squares(compute_residual, angles, max_nfev=30).x
            is_stable = np.abs(found - angles).max() < 1e-6
            angles = found
            if is_stable:
                break
        distance = float(np.max(cKDTree(place_finger(palm_link, finger, angles, coded)).query(points)[0]))
        if distance < smallest:
            best, smallest = angles, distance
        if smallest < 5e-5:
            break
    return best, smallest


@lru_cache(maxsize=4)
def recover(name: str, coded: bool = True) -> Closing:
    """Recover poses and joint angles of the closing around the object `name`, "cylinder" or "box".

    coded: fit of the fingers with the coded centres, else with the true centres.
    """
    raw, kept = read_points(f"simulated_contacts_{name}_raw"), read_points(f"simulated_contacts_{name}_within_5_mm")
    palm_link = np.eye(4)
    is_palm = np.abs(kept[:, 1] - 0.0514) < 3e-4
    palm = read_coded_centres("palm")
    assert palm is not None
    on_palm = apply(compute_frames()["palm_bracket"], palm)
    palm_link[2, 3] = 0.105
    for _ in range(20):
        distance, nearest = cKDTree(apply(palm_link, on_palm)).query(kept[is_palm])
        palm_link[2, 3] += np.mean(kept[is_palm, 2] - apply(palm_link, on_palm)[nearest, 2])
    residual = {"palm": 1e3 * float(np.max(distance))}
    angles: dict[str, float] = {}
    for finger, (_, first, (low, high)) in FINGERS.items():
        points = kept[~is_palm & (kept[:, 0] > low) & (kept[:, 0] < high)]
        found, largest = fit_finger(palm_link, finger, points, STARTS[name], coded)
        residual[finger] = 1e3 * largest
        angles |= {f"joint_{first + i}_0": float(angle) for i, angle in enumerate(found)}
    item, pose = fit_object(name, raw[raw[:, 2] > GROUND_M])
    return Closing(name, raw, kept, item, pose, palm_link, angles, residual)


def fit_object(name: str, points: FloatArray) -> tuple[GraspObject, FloatArray]:
    """Object and its pose in the world, f64[4, 4], from the contact points on it; its axis is the world's x axis."""
    if name == "box":
        # Its faces towards the palm and towards the ground are those that the most points lie on.
        centre = points.min(axis=0)[1:] + BOX_SIDE_M / 2
        item = GraspObject("box", ConvexPolytope.box(BOX_SIDE_M, BOX_SIDE_M, BAR_LENGTH_M), "Box of the Gazebo model")
    else:

        def compute_residual(centre: FloatArray) -> FloatArray:
            """Distances of the points from the surface around an axis at `centre` f64[2], f64[c], metres."""
            return np.asarray(np.hypot(*(points[:, 1:] - centre).T) - RADIUS_M)

        centre = least_squares(compute_residual, [0.07, 0.094], loss="soft_l1", f_scale=2e-4).x
        item = GraspObject("cylinder", Cylinder(RADIUS_M, BAR_LENGTH_M), "Cylinder of the Gazebo model")
    pose = np.eye(4)
    pose[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    pose[:3, 3] = BAR_START_M, *centre
    return item, pose


def count_kept(closing: Closing) -> tuple[int, int]:
    """Numbers of taxels that the original filter kept, and that this tool finds: palm and fingers without the thumb."""
    palm = read_coded_centres("palm")
    assert palm is not None
    parts = [apply(closing.palm_link @ compute_frames()["palm_bracket"], palm)]
    for finger, (_, first, _) in FINGERS.items():
        angles = np.array([closing.angles[f"joint_{first + i}_0"] for i in range(4)])
        parts.append(place_finger(closing.palm_link, finger, angles))
    distance = np.asarray(cKDTree(closing.raw).query(np.concatenate(parts))[0])
    return int((closing.kept[:, 2] > GROUND_M).sum()), int((distance < FILTER_M).sum())


def count_by_rule(closing: Closing) -> dict[str, int]:
    """Number of taxels that the recorded points activate, by threshold (mm) and kind of centres."""
    scene, palm, angles = make_scene(closing, OriginalRules())
    sensors = compute_sensor_poses(scene, palm, angles)
    numbers = {}
    for coded in (True, False):
        names = ("half_diagonal", "final", "winter_2022")
        for threshold, taxels in activate(select_recorded(closing), None, sensors, names, coded).items():
            numbers[f"{threshold} {'coded' if coded else 'true'}"] = len(taxels)
    return numbers


def compute_sensor_poses(scene: Scene, palm: FloatArray, angles: FloatArray) -> FloatArray:
    """Poses of the brackets in the world, f64[s, 4, 4]. palm: f64[4, 4]. angles: f64[j], radians."""
    robot = load_robot("ur5e_original").get_subtree("palm")
    return np.asarray(palm @ Kinematics(robot, scene.hand).compute_sensor_poses(angles))


def make_scene(closing: Closing, rules: OriginalRules) -> tuple[Scene, FloatArray, FloatArray]:
    """Scene of the closing, pose of the palm in the world f64[4, 4], and recovered joint angles f64[j], radians."""
    hand = load_hand("original")
    scene = build_scene(hand, closing.item, "palm", layer_m=get_surface_heights(hand, rules))
    palm = closing.palm_link @ inverse(map_to_palm(np.eye(4)))
    angles = np.array([closing.angles.get(JOINT_NAMES[name], 0.0) for name in scene.joint_names])
    return scene, palm, angles


def select_recorded(closing: Closing) -> FloatArray:
    """Recorded contact points on the hand and the object, f64[c, 3], without those on the ground."""
    return closing.raw[closing.raw[:, 2] > GROUND_M]


def describe(source: str, closing: Closing, points: FloatArray, active: Active, reference: Active) -> Row:
    """Figures of contact points f64[c, 3] of a closing.

    active, reference: taxels that these points and the recorded points activate.
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
    """Taxels that the rule of the plug-in activates, by threshold.

    points: f64[c, 3], world. board_of_point: board that keeps each point; None: every board. sensors: f64[s, 4, 4],
    brackets in the world. thresholds: names in `THRESHOLD_HISTORY_M`. coded: coded centres, else true centres.
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
    """Recorded contact points of a closing, and those of MuJoCo in the same posture and in a closing of its own."""
    closing, rules = recover(name), replace(OriginalRules(), palm_tips_m=TIPS_M[name])
    scene, palm, angles = make_scene(closing, rules)
    sensors = compute_sensor_poses(scene, palm, angles)
    reference = activate(select_recorded(closing), None, sensors)
    rows = [describe("recorded", closing, select_recorded(closing), reference, reference)]

    data = mujoco.MjData(scene.model)
    for body, pose in ((scene.model.body("mount").id, closing.object_pose), (scene.link_bodies[0], palm)):
        index = scene.model.body_mocapid[body]
        data.mocap_pos[index], data.mocap_quat[index] = pose[:3, 3], to_quaternion(pose)
    data.qpos[scene.joint_addresses] = angles
    mujoco.mj_forward(scene.model, data)
    recorder = MessageRecorder(scene, make_recorder_settings(scene.hand, rules))
    recorder.observe(data, 0.1)
    recorder.send()
    rows.append(_describe_messages("MuJoCo, recovered posture", closing, recorder.messages, sensors, reference))

    is_fixed = np.array([joint.endswith("_j0") or joint.startswith("th") for joint in scene.joint_names])
    approach = Approach(
        name,
        "bar",
        inverse(closing.object_pose) @ palm,
        np.where(is_fixed, angles, 0.0),
        np.where(is_fixed, angles, np.nan),
        np.where(is_fixed, 0.0, TORQUE_NM),
    )
    settings = SimulationSettings(object_pose=closing.object_pose, recorder=make_recorder_settings(scene.hand, rules))
    motion = simulate_grasp(scene, approach, Timeline(0.0, 3.0, 1.0, 0.0, 0.0), settings)
    assert motion.messages is not None
    end = replace(closing, object_pose=motion.object_pose[-1])
    rows.append(_describe_messages("MuJoCo, closing", end, motion.messages, motion.sensor_poses[-1], reference))
    return closing, rows


def _describe_messages(
    source: str, closing: Closing, messages: Iterable[ContactMessage], sensors: FloatArray, reference: Active
) -> Row:
    """Figures of the contact points that the boards keep after the messages. sensors: f64[s, 4, 4]."""
    memory = ContactMemory(OriginalRules())
    for message in messages:
        memory.receive(message)
    stored = [memory.get_points(index).position for index in range(len(sensors))]
    board = np.repeat(np.arange(len(stored)), [len(one) for one in stored])
    points = np.concatenate(stored)
    return describe(source, closing, points, activate(points, board, sensors), reference)


def format_closing(closing: Closing, rows: Sequence[Row]) -> str:
    """Text of the comparison of one closing, with a Markdown table."""
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
    """Print the comparison of both closings."""
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
