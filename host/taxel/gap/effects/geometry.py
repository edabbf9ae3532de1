"""Where a displaced object or bracket presses: rays along the taxels' normals onto the objects' meshes."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from taxel.gap.boards import PIECES
from taxel.gap.state import State
from taxel.grasp.shapes import ConvexPolytope, ShapeError
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_tables import ObjectMesh

Array = NDArray[np.float64]

NEAR_M: Final = 0.006
"""A piece that is farther from contact than this stays out of it."""

FAR_M: Final = 1.0
"""Beyond the deepest press that a simulator has made: no layer is so thick."""

COARSE: Final = 16
MOST_STEPS: Final = 40
CLOSE: Final = 1e-11
"""Relative error of a board's net force."""

REMEMBERED: Final = 20000
"""Displacements whose forces are kept."""

LEAST_DETERMINANT: Final = 1e-15
"""Square metres; a triangle that a ray sees smaller is met edge-on."""

MOST_AT_ONCE: Final = 200_000
"""Rays times triangles: what stays in a core's cache."""

CONVEX: Final = 0.999
"""Share of its hull that a solid fills if it counts as convex."""


@dataclass(frozen=True, eq=False)
class Contact:
    """One board in one cell during hold. taxels: [m]. force: f64[m], newtons. points, normals: f64[m, 9, 3], of their
    pieces, bracket frame. object_from_board: f64[4, 4].
    """

    cell: int
    board: int
    taxels: NDArray[np.intp]
    force: Array
    points: Array
    normals: Array
    object_from_board: Array

    @cached_property
    def board_from_object(self) -> Array:
        """The other way."""
        return np.asarray(np.linalg.inv(self.object_from_board))


class Mesh:
    """An object's mesh as something that a ray can meet."""

    def __init__(self, mesh: ObjectMesh) -> None:
        self._triangles = mesh.vertices[mesh.faces]
        self._shape = _convex(mesh)

    def separation(self, points: Array, directions: Array) -> Array:
        """Signed distance along each ray f64[m, 3] to where it enters, f64[m]; inf where it misses."""
        if self._shape is not None:
            return self._shape.ray_separation(points, directions)
        return _through_triangles(self._triangles, points, directions)


def _convex(mesh: ObjectMesh) -> ConvexPolytope | None:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    volume = float(np.einsum("fi,fi->", a, np.cross(b, c))) / 6.0
    try:
        if volume < CONVEX * ConvexHull(mesh.vertices).volume:
            return None
        return ConvexPolytope.from_mesh(mesh.vertices)
    except (QhullError, ShapeError):
        return None


def _through_triangles(triangles: Array, points: Array, directions: Array) -> Array:
    """Moller and Trumbore 1997, their triple products written so that what hangs on rays and on triangles are factors
    of matrices; the entry that lies nearest to the point counts.
    """
    corner = triangles[:, 0]
    first, second = triangles[:, 1] - corner, triangles[:, 2] - corner
    normal, about_second, about_first = np.cross(first, second), np.cross(second, corner), np.cross(corner, first)
    level = np.einsum("ti,ti->t", corner, normal)
    nearest = np.full(len(points), np.inf)
    for rows in np.array_split(np.arange(len(points)), -(-len(points) * len(triangles) // MOST_AT_ONCE) or 1):
        ray, moment = directions[rows], np.cross(points[rows], directions[rows])
        determinant = -(ray @ normal.T)
        u = moment @ second.T - ray @ about_second.T
        v = -(moment @ first.T) - ray @ about_first.T
        # A positive determinant: the ray comes from outside.
        hit = (determinant > LEAST_DETERMINANT) & (u >= 0) & (v >= 0) & (u + v <= determinant)
        ray_at, triangle = np.nonzero(hit)
        at = (points[rows][ray_at] * normal[triangle]).sum(axis=1) - level[triangle]
        at /= determinant[ray_at, triangle]
        order = np.argsort(np.abs(at), kind="stable")[::-1]
        nearest[rows[ray_at[order]]] = at[order]  # the last one stays: the nearest
    return nearest


@dataclass(frozen=True, eq=False)
class Law:
    """Force over depth of a taxel's layer, as the simulator's own data tell: both f64[k], rising from 0."""

    depth_m: Array
    force_n: Array

    @cached_property
    def _longer(self) -> tuple[Array, Array]:
        """Depth and force with one more point, far along the last tangent."""
        slope = (self.force_n[-1] - self.force_n[-2]) / (self.depth_m[-1] - self.depth_m[-2])
        return np.append(self.depth_m, self.depth_m[-1] + FAR_M), np.append(
            self.force_n, self.force_n[-1] + slope * FAR_M
        )

    def force(self, depth: Array) -> Array:
        """Newtons; none where nothing is pressed, beyond the last point along its tangent."""
        return np.asarray(np.interp(depth, *self._longer))

    def depth(self, force: Array) -> Array:
        """Metres; the same read the other way."""
        return np.asarray(np.interp(force, *self._longer[::-1]))


def law_of(state: State) -> Law:
    """The layer's law: medians of force over depth, made rising; a straight line where too few taxels are pressed, or
    hardly, as by a rigid contact.
    """
    force, separation = state.base.force, state.base.separation
    assert force is not None
    assert separation is not None
    pressed = (separation < 0) & (force > 0.02)
    depth, newtons = -separation[pressed], force[pressed]
    stated = state.model.contact_stiffness_n_per_m
    stiffness = stated or (float(np.median(newtons / depth)) if len(depth) else 1000.0)
    line = Law(np.array([0.0, 1e-3]), np.array([0.0, 1e-3 * stiffness]))
    if len(depth) < 200:
        return line
    edges = np.quantile(depth, np.linspace(0.0, 0.995, 25))
    middle, level = [0.0], [0.0]
    for low, high in pairwise(edges.tolist()):
        own = (depth >= low) & (depth <= high)
        if own.sum() >= 5 and np.median(depth[own]) > middle[-1] + 1e-6:
            middle.append(float(np.median(depth[own])))
            level.append(max(float(np.median(newtons[own])), level[-1] + 1e-4))
    return Law(np.array(middle), np.array(level)) if len(middle) > 1 else line


@dataclass(frozen=True, eq=False)
class Geometry:
    """What displacements need of a state. contacts: of every board that bears in a cell. meshes: by object name. rest:
    pressures f64[m, 9] of each contact's pieces where nothing is displaced.
    """

    contacts: tuple[Contact, ...]
    meshes: dict[str, Mesh]
    law: Law
    rest: tuple[Array, ...]
    _known: dict[tuple[int, bytes], Array] = field(default_factory=dict)

    @cached_property
    def shares(self) -> dict[tuple[int, int], Array]:
        """Which share of a taxel's force each of its pieces bears, f64[m, 9], by cell and board; all the same where by
        the meshes none is pressed.
        """
        found = {}
        for contact, pressure in zip(self.contacts, self.rest, strict=True):
            whole = pressure.sum(axis=1, keepdims=True)
            even = np.full_like(pressure, 1.0 / PIECES**2)
            found[contact.cell, contact.board] = np.divide(pressure, whole, out=even, where=whole > 0.0)
        return found

    def displaced(self, state: State, number: int, motion: Array) -> Array:
        """Forces on a contact's taxels, f64[m], when the board moves by `motion` f64[4, 4] in the object's view.

        The board's approach is solved anew so that its net force stays. A fit moves one block after another, and other
        effects beside: what it has asked before is remembered.
        """
        key = (number, motion.tobytes())
        known = self._known.get(key)
        if known is None:
            contact = self.contacts[number]
            mesh = self.meshes[state.pair.cells[contact.cell][0]]
            depth = piece_depth(mesh, motion @ contact.object_from_board, contact)
            known = pressed_to(self.law, depth, float(contact.force.sum())).mean(axis=1)
            if len(self._known) >= REMEMBERED:
                self._known.clear()
            self._known[key] = known
        return known


def piece_depth(mesh: Mesh, object_from_board: Array, contact: Contact) -> Array:
    """How far each piece is pressed in, f64[m, 9], metres; very negative where its ray misses."""
    turn, offset = object_from_board[:3, :3], object_from_board[:3, 3]
    points, normals = contact.points @ turn.T + offset, contact.normals @ turn.T
    shape = points.shape[:2]
    apart = mesh.separation(points.reshape(-1, 3), normals.reshape(-1, 3)).reshape(shape)
    return np.asarray(np.where(np.isfinite(apart), -apart, -1.0))


def pressed_to(law: Law, depth: Array, net_force: float) -> Array:
    """Pressures f64[m, 9] of pieces pressed in by `depth` f64[m, 9], as the force of a taxel that is pressed so all
    over, when the board approaches until they bear the net force.
    """
    low, high = -float(depth.max()), -float(depth.max()) + float(law.depth_m[-1]) + NEAR_M
    near, wanted = depth[depth + high > 0.0], net_force * depth.shape[1]

    def beyond(shift: float | Array) -> Array:
        return np.asarray(law.force(near + shift).sum(axis=-1) - wanted)

    # The force rises with the shift. Many shifts at once tell about where; then a false position that halves the end
    # which stays (the Illinois rule).
    coarse = np.linspace(low, high, COARSE)
    known = beyond(coarse[:, None])
    first = int(np.argmax(known > 0.0))
    if not first:
        return np.asarray(law.force(depth + high))
    low, high, below, above = (float(one) for one in (*coarse[first - 1 : first + 1], *known[first - 1 : first + 1]))
    stays = 0
    for _ in range(MOST_STEPS):
        middle = high - above * (high - low) / (above - below)
        value = float(beyond(middle))
        if abs(value) <= CLOSE * wanted:
            break
        if value < 0:
            low, below = middle, value
            above *= 0.5 if stays > 0 else 1.0
            stays = 1
        else:
            high, above = middle, value
            below *= 0.5 if stays < 0 else 1.0
            stays = -1
    return np.asarray(law.force(depth + middle))


@lru_cache(maxsize=8)
def geometry_of(state: State) -> Geometry:
    """Work out, once for a state, where boards bear."""
    pair = state.pair
    assert state.base.force is not None
    law = law_of(state)
    meshes = {name: Mesh(pair.objects[name]) for name in pair.object_names}
    hold = state.clock.phase == Phase.HOLD
    contacts = []
    for cell in range(len(pair.cells)):
        force = state.base.force[state.cell == cell][:, hold].mean(axis=(0, 1))
        for board, layout in enumerate(pair.boards):
            taxels = layout.taxels
            if force[taxels].sum() < 0.05:
                continue
            pose = np.linalg.inv(pair.object_poses[cell]) @ pair.sensor_poses[cell, board]
            normals = np.repeat(pair.taxels.normal[taxels][:, None], PIECES**2, axis=1)
            contacts.append(Contact(cell, board, taxels, force[taxels], layout.pieces, normals, pose))
    rest = tuple(
        pressed_to(
            law, piece_depth(meshes[pair.cells[one.cell][0]], one.object_from_board, one), float(one.force.sum())
        )
        for one in contacts
    )
    return Geometry(tuple(contacts), meshes, law, rest)
