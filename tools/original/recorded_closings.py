"""Postures of two recorded closings of the original simulator, recovered from their contact points.

The poses of hand and object and the joint angles follow from raw contact points and kept taxel centres
(tools/hand/original/simulated_contacts_*.csv).
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).parents[1] / "hand"))
from original_figures import compute_frames, read_coded_centres, read_rows, read_taxels

from taxel.grasp.objects import GraspObject
from taxel.grasp.shapes import ConvexPolytope, Cylinder
from taxel.hand.transforms import apply
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

STARTS: Final = {"cylinder": (0.0, 1.49, 1.03, 1.35), "box": (0.0, 1.5, 0.63, 1.75)}
"""First guess of the joint angles of every finger, radians."""


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


def read_points(name: str) -> FloatArray:
    """Read the points of tools/hand/original/NAME.csv, f64[c, 3], metres."""
    return np.array([[float(row[f"{axis}_m"]) for axis in "xyz"] for row in read_rows(name)])


def place_finger(palm_link: FloatArray, finger: str, angles: FloatArray, coded: bool = True) -> FloatArray:
    """Return the taxel centres f64[n, 3] of a finger's front boards in the world, metres.

    angles: f64[4], joint angles in radians. coded: use the centres in the original code instead of the true ones.
    """
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
    """Fit a finger's joint angles such that its taxel centres coincide with the points f64[k, 3].

    Returns the angles f64[4] in radians and the largest remaining distance in metres. start: first guess. coded: use
    the centres in the original code instead of the true ones.
    """
    # Up to 60 fits from random angles around the first guess; a largest distance below 0.05 mm ends the search. Each
    # fit alternates between nearest centres and angles until the angles are constant.
    rng = np.random.default_rng(0)
    best, smallest = np.zeros(4), np.inf
    for _ in range(60):
        angles = np.asarray(start) + rng.normal(size=4) * (0.05, 0.08, 0.12, 0.12)
        for _ in range(25):
            nearest = np.asarray(cKDTree(place_finger(palm_link, finger, angles, coded)).query(points)[1])

            def compute_residual(values: FloatArray, nearest: IndexArray = nearest) -> FloatArray:
                """Compute the differences between the nearest centres and the points, f64[3 k], metres."""
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
    """Recover the poses and joint angles of the closing around the object `name`, "cylinder" or "box".

    coded: fit the fingers with the centres in the original code instead of the true ones.
    """
    raw, kept = read_points(f"simulated_contacts_{name}_raw"), read_points(f"simulated_contacts_{name}_within_5_mm")
    palm_link = np.eye(4)
    is_palm = np.abs(kept[:, 1] - 0.0514) < 3e-4  # the taxel centres of the palm lie in the plane y = 51.4 mm
    palm = read_coded_centres("palm")
    assert palm is not None
    on_palm = apply(compute_frames()["palm_bracket"], palm)
    palm_link[2, 3] = 0.105  # first guess of the height, metres; only the height is fitted
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
    """Return the object of a closing and its pose f64[4, 4] in the world, fitted to the contact points on the object.

    name: "box" or "cylinder". points: f64[c, 3], metres. The axis of the object is the world's x axis.
    """
    if name == "box":
        # The smallest y and z of the points lie on the faces of the box towards the palm and towards the ground.
        centre = points.min(axis=0)[1:] + BOX_SIDE_M / 2
        item = GraspObject("box", ConvexPolytope.box(BOX_SIDE_M, BOX_SIDE_M, BAR_LENGTH_M), "Box of the Gazebo model")
    else:

        def compute_residual(centre: FloatArray) -> FloatArray:
            """Compute the distances f64[c] of the points from the cylinder's surface, metres.

            centre: f64[2], y and z of its axis.
            """
            return np.asarray(np.hypot(*(points[:, 1:] - centre).T) - RADIUS_M)

        # first guess of the axis (y, z), metres; the loss limits the influence of points on other bodies
        centre = least_squares(compute_residual, [0.07, 0.094], loss="soft_l1", f_scale=2e-4).x
        item = GraspObject("cylinder", Cylinder(RADIUS_M, BAR_LENGTH_M), "Cylinder of the Gazebo model")
    pose = np.eye(4)
    # The z axis of the object, the axis of the bar, is the world's x axis.
    pose[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    pose[:3, 3] = BAR_START_M, *centre
    return item, pose


def count_kept(closing: Closing) -> tuple[int, int]:
    """Return how many taxels the original filter kept, and how many taxels this program places within the distance of
    the filter (`FILTER_M`) from a recorded contact point.

    Both count the taxels of palm and fingers without the thumb, which lies on the ground (`GROUND_M`) in the recorded
    closings.
    """
    palm = read_coded_centres("palm")
    assert palm is not None
    parts = [apply(closing.palm_link @ compute_frames()["palm_bracket"], palm)]
    for finger, (_, first, _) in FINGERS.items():
        angles = np.array([closing.angles[f"joint_{first + i}_0"] for i in range(4)])
        parts.append(place_finger(closing.palm_link, finger, angles))
    distance = np.asarray(cKDTree(closing.raw).query(np.concatenate(parts))[0])
    return int((closing.kept[:, 2] > GROUND_M).sum()), int((distance < FILTER_M).sum())


def select_recorded(closing: Closing) -> FloatArray:
    """Return the recorded contact points f64[c, 3] on the hand and the object, without those on the ground."""
    return closing.raw[closing.raw[:, 2] > GROUND_M]
