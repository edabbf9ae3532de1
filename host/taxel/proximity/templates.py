"""Templates: assumed shapes of targets in front of a window of taxels, with the gaps and signals that they cause.

Shape, nearest point and tilt of a target are unknown. The set of templates covers the patterns of signals that they can
cause: planes at several tilts, spheres, cylinders, flat ends, and plates whose edge crosses the window.
"""

from dataclasses import dataclass

import numpy as np

from taxel.proximity.response import look_up
from taxel.proximity.skin_points import MIN_COSINE, NO_GAP_M, SkinPoints
from taxel.types import BoolArray, FloatArray, IntArray

WINDOW_RADIUS_M = 0.0135
"""Radius of the window of taxels that are compared with templates: 5 x 5 taxels at a 5 mm pitch without the corners.
The distance is that of a target's nearest point; the signals of taxels outside the window depend on other parts of the
target."""

TILTS_DEG = (3.0, 6.0, 10.0, 15.0, 20.0)
SPHERE_RADII_M = (0.006, 0.008, 0.0105, 0.014, 0.019, 0.027)
CYLINDER_RADII_M = (0.006, 0.009, 0.013, 0.020)
PUNCH_RADII_M = (0.006, 0.009)
"""Radii of flat ends."""
VERTEX_OFFSETS_M = (-0.002, 0.0, 0.002)
"""Positions of the nearest point beside the centre of the window: a third of a pitch of 6 mm."""
EDGE_OFFSETS_M = (0.0, 0.0025, 0.005)
"""Distances from the centre of the window to the edge of a plate."""

RIDGE_TILTS_DEG = (5.0, 10.0)
"""Tilts of plates whose edge or corner is their nearest part."""

TIP_OFFSETS_M = (0.0, 0.002, 0.004)
"""Distances along both edges from the centre of the window to a corner. The taxel with the largest signal, at which the
window is centred, lies inside the corner, where the plate covers it."""


STRIP_WIDTHS_M = (0.008, 0.013, 0.020)
SQUARE_SIDES_M = (0.013, 0.019, 0.026)
"""Widths of long flat faces, and side lengths of square faces."""

FAMILY_WEIGHTS = {
    "plane": 0.2,
    "sphere": 0.15,
    "cylinder": 0.15,
    "edge": 0.1,
    "punch": 0.1,
    "ridge": 0.1,
    "tip": 0.1,
    "strip": 0.05,
    "square": 0.1,
    "corner": 0.05,
}
"""Prior probability of each family of templates (chosen: no shape is excluded, plates and palms are frequent)."""


@dataclass(frozen=True, eq=False)
class Window:
    """The n taxels around a centre, and the gaps of K templates at the 9 skin points of each taxel.

    taxels: i64[n], indices on the board. contact_gap_m: f64[K, n, 9], gaps for templates that just touch the skin.
    rate: f64[n, 9], growth of the gap per metre of distance. weight: f64[K], prior probability of each template.
    radius_m: f64[n], distance of each taxel from the centre.
    """

    taxels: IntArray
    contact_gap_m: FloatArray
    rate: FloatArray
    weight: FloatArray
    radius_m: FloatArray

    @property
    def count(self) -> int:
        """Number of templates."""
        return len(self.weight)

    def predict(self, table: FloatArray, distance_m: FloatArray) -> FloatArray:
        """Predict the signals of all templates at G distances, f64[K, G, n], counts.

        table: tabulated response curve (`ResponseCurve.make_table`). distance_m: f64[G].
        """
        rate = (distance_m[:, None, None] * self.rate).astype(np.float32)
        contact = self.contact_gap_m.astype(np.float32)
        return np.stack([look_up(table, gap + rate).mean(axis=-1) for gap in contact])


def make_window(points: SkinPoints, centre: int) -> Window:
    """Make the window of the taxels around the taxel `centre`, with the gaps of all templates."""
    origin, axis = points.centre[centre], points.normal[centre]
    is_near = np.linalg.norm(points.centre - origin, axis=1) <= WINDOW_RADIUS_M
    taxels = np.flatnonzero(is_near & (points.normal @ axis > MIN_COSINE))
    # Window frame: third axis along the normal, first axis perpendicular to it and to the coordinate axis that is most
    # nearly perpendicular to the normal.
    first = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(axis, first)
    x /= np.linalg.norm(x)
    frame = np.stack([x, np.cross(axis, x), axis])
    local = (points.position[taxels] - origin) @ frame.T
    cosine = points.direction[taxels] @ axis
    faces, rate = cosine > MIN_COSINE, 1.0 / np.maximum(cosine, MIN_COSINE)
    heights, weights = [], []
    for family, members in (
        ("plane", _plane_heights(local)),
        ("sphere", _sphere_heights(local)),
        ("cylinder", _cylinder_heights(local)),
        ("edge", _edge_heights(local)),
        ("punch", _punch_heights(local)),
        ("ridge", _ridge_heights(local)),
        ("strip", _strip_heights(local)),
        ("square", _square_heights(local)),
        ("corner", _corner_heights(local)),
        ("tip", _tip_heights(local)),
    ):
        heights += members
        weights += [FAMILY_WEIGHTS[family] / len(members)] * len(members)
    gap = np.stack(heights) - local[..., 2]
    gap -= gap.min(axis=(1, 2), keepdims=True)  # each template touches the skin at its nearest point
    # To first order, a target at the height g above a point has the gap g / cosine along the point's normal.
    gap = np.where(faces & (gap < 0.5 * NO_GAP_M), gap * rate, NO_GAP_M)
    radius = np.linalg.norm(points.centre[taxels] - origin, axis=1)
    return Window(taxels, gap, rate, np.array(weights), radius)


# Each function _..._heights returns the heights of the templates of one family above the tangent plane at the window's
# centre, f64[n, 9] each, metres; `NO_GAP_M` where the target does not cover a point. local: f64[n, 9, 3], coordinates
# of the skin points with the third axis along the normal of the centre.


def _plane_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of planes through the window's centre, parallel to the skin and at several tilts, metres."""
    members = [np.zeros(local.shape[:2])]
    for tilt in np.deg2rad(TILTS_DEG):
        for azimuth in np.arange(8) * np.pi / 4:
            members.append(np.tan(tilt) * (local[..., 0] * np.cos(azimuth) + local[..., 1] * np.sin(azimuth)))
    return members


def _round_height(squared_m2: FloatArray, radius_m: float) -> FloatArray:
    """Return the height of the lower surface of a sphere or cylinder above its lowest point or line, metres.

    squared_m2: squared distance from the lowest point or line, parallel to the skin at the window's centre. radius_m:
    radius of the sphere or cylinder. The height is `NO_GAP_M` beyond the radius.
    """
    covers = squared_m2 < radius_m**2
    return np.where(covers, radius_m - np.sqrt(np.where(covers, radius_m**2 - squared_m2, 0.0)), NO_GAP_M)


def _sphere_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of spheres whose lowest points are at and around the window's centre, metres."""
    return [
        _round_height((local[..., 0] - u) ** 2 + (local[..., 1] - v) ** 2, radius)
        for radius in SPHERE_RADII_M
        for u in VERTEX_OFFSETS_M
        for v in VERTEX_OFFSETS_M
    ]


def _cylinder_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of cylinders whose axes are parallel to the skin, metres: four angles, several offsets."""
    members = []
    for radius in CYLINDER_RADII_M:
        for angle in np.arange(4) * np.pi / 4:
            across = local[..., 0] * np.cos(angle) + local[..., 1] * np.sin(angle)
            members += [_round_height((across - offset) ** 2, radius) for offset in VERTEX_OFFSETS_M]
    return members


def _edge_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of plates parallel to the skin whose straight edge crosses the window, metres."""
    members = []
    for angle in np.arange(8) * np.pi / 4:
        across = local[..., 0] * np.cos(angle) + local[..., 1] * np.sin(angle)
        members += [np.where(across <= offset, 0.0, NO_GAP_M) for offset in EDGE_OFFSETS_M]
    return members


def _punch_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of flat round ends (punches) parallel to the skin, metres."""
    members = []
    for radius in PUNCH_RADII_M:
        for u in VERTEX_OFFSETS_M:
            for v in VERTEX_OFFSETS_M:
                covers = (local[..., 0] - u) ** 2 + (local[..., 1] - v) ** 2 <= radius**2
                members.append(np.where(covers, 0.0, NO_GAP_M))
    return members


def _ridge_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of tilted plates whose lowest part is a straight edge inside the window, metres."""
    members = []
    for angle in np.arange(8) * np.pi / 4:
        across = local[..., 0] * np.cos(angle) + local[..., 1] * np.sin(angle)
        for tilt in np.deg2rad(RIDGE_TILTS_DEG):
            for offset in EDGE_OFFSETS_M:
                members.append(np.where(across <= offset, np.tan(tilt) * (offset - across), NO_GAP_M))
    return members


def _rotate(local: FloatArray, angle: float) -> tuple[FloatArray, FloatArray]:
    """Return the coordinates in the tangent plane along axes rotated by `angle` (radians), f64[n, 9] each, metres."""
    along = local[..., 0] * np.cos(angle) + local[..., 1] * np.sin(angle)
    return along, local[..., 1] * np.cos(angle) - local[..., 0] * np.sin(angle)


def _make_face_heights(is_inside: BoolArray) -> FloatArray:
    """Return the heights of a flat face that touches the points inside it: 0 there, `NO_GAP_M` outside, metres."""
    return np.where(is_inside, 0.0, NO_GAP_M)


def _strip_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of long flat faces parallel to the skin, metres."""
    return [
        _make_face_heights(np.abs(_rotate(local, angle)[0] - offset) <= 0.5 * width)
        for width in STRIP_WIDTHS_M
        for angle in np.arange(4) * np.pi / 4
        for offset in VERTEX_OFFSETS_M
    ]


def _square_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of flat square faces parallel to the skin, metres."""
    members = []
    for side in SQUARE_SIDES_M:
        for angle in (0.0, np.pi / 4):
            along, across = _rotate(local, angle)
            for u in VERTEX_OFFSETS_M:
                for v in VERTEX_OFFSETS_M:
                    is_inside = (np.abs(along - u) <= 0.5 * side) & (np.abs(across - v) <= 0.5 * side)
                    members.append(_make_face_heights(is_inside))
    return members


def _corner_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of plates parallel to the skin with a corner inside the window, metres."""
    members = []
    for angle in np.arange(8) * np.pi / 4:
        along, across = _rotate(local, angle)
        offsets = EDGE_OFFSETS_M[:2]
        members += [_make_face_heights((along <= u) & (across <= v)) for u in offsets for v in offsets]
    return members


def _tip_heights(local: FloatArray) -> list[FloatArray]:
    """Return the heights of tilted plates whose lowest part is a corner inside the window, metres."""
    members = []
    for angle in np.arange(8) * np.pi / 4:
        along, across = _rotate(local, angle)
        for tilt in np.deg2rad(RIDGE_TILTS_DEG):
            for offset in TIP_OFFSETS_M:
                is_covered = (along <= offset) & (across <= offset)
                # The plate rises along the diagonal of the corner; sqrt(0.5) projects the sum of both distances on it.
                height = np.tan(tilt) * np.sqrt(0.5) * (2.0 * offset - along - across)
                members.append(np.where(is_covered, height, NO_GAP_M))
    return members
