"""Messages of contact sensors as Gazebo sends them: all contacts of a board in one period, grouped by colliding pair.

A contact sensor belongs to one collision body, here a board, and sends one message at the end of each period. The
message lists one entry for each physics step and pair of bodies in contact; a reader that keeps only the first entry of
each pair obtains the contact points of the first step of the period at which the pair touches.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from taxel.hand.transforms import apply, inverse
from taxel.sim.scene import Scene
from taxel.types import FloatArray

MESSAGE_HZ: Final = 5.0
"""Messages of a contact sensor per second. Source: update rate of the 19 contact sensors of the original simulation."""

OBJECT: Final = -1
"""Number of the object among the bodies of a `PairEntry`."""

FIRST_OTHER: Final = -2
"""Largest number of a body that is neither a board nor the object; each such body has a number of its own."""

_ROUNDING_S: Final = 1e-9
"""Tolerance of period boundaries, seconds: times are sums of time steps."""


@dataclass(frozen=True, eq=False)
class PairEntry:
    """Contact points of one pair of bodies at one time.

    Attributes:
        bodies: the two bodies in the order of the physics engine: index in `hand.boards`, `OBJECT`, or a
            number of at most `FIRST_OTHER`.
        position: f64[c, 3], metres, world.
        force_n: f64[c], norm of the contact force at each point, newtons.
    """

    bodies: tuple[int, int]
    position: FloatArray
    force_n: FloatArray


@dataclass(frozen=True, eq=False)
class ContactMessage:
    """One message of the contact sensor of one board.

    Attributes:
        time_s: end of the period, seconds of the grasp.
        board: index in `hand.boards` of the sensor's board.
        entries: pairs in the order in which they came into contact; none without contact.
    """

    time_s: float
    board: int
    entries: tuple[PairEntry, ...]


@dataclass(frozen=True, eq=False)
class ContactTips:
    """Points of a board whose contact with the object replaces the contact points that the physics engine reports.

    The points ("tips") are tips on the surface of the board, or corners of the original mesh; the physics engine
    simulates only their convex hull. While the hull touches the object, the tip nearest to the object touches, and so
    does every tip that is at most `offset_m` farther from the object than the nearest one: a curved object sinks
    between the tips, and bodies of the original engine overlap.

    Attributes:
        board: index in `hand.boards`.
        position: f64[m, 3], tips in the frame of the board's bracket, metres.
        offset_m: additional distance up to which a point touches, metres.
        reach_m: largest distance from the object at which the nearest tip touches, metres. If the nearest tip is
            farther away, for example at a contact of the bracket's edge, the engine's contact points are used.
    """

    board: int
    position: FloatArray
    offset_m: float
    reach_m: float = float("inf")


@dataclass(frozen=True)
class RecorderSettings:
    """Settings of the recorded contact sensors.

    Attributes:
        message_hz: messages per second.
        first_entries_only: only the first entry of each pair in a period is recorded, which is faster than all entries.
        tips: tips of boards whose contact points they replace.
    """

    message_hz: float = MESSAGE_HZ
    first_entries_only: bool = True
    tips: tuple[ContactTips, ...] = ()


class MessageRecorder:
    """Collects the contacts of a simulated grasp and divides them into messages of all boards."""

    def __init__(self, scene: Scene, settings: RecorderSettings) -> None:
        """Record one message of each board of `scene` in every period."""
        self.messages: list[ContactMessage] = []
        self._scene = scene
        self._settings = settings
        self._period = 0
        # Body of each geom, as in `PairEntry.bodies`: index of the board, `OBJECT`, or a number of its own.
        self._body = np.where(scene.board_of_geom >= 0, scene.board_of_geom, FIRST_OTHER - np.arange(scene.model.ngeom))
        self._body[scene.model.geom("object").id] = OBJECT
        self._entries: list[PairEntry] = []
        self._seen: set[frozenset[int]] = set()

    def observe(self, data: mujoco.MjData, time_s: float) -> None:
        """Add the contacts after the time step that ends at `time_s` seconds of the grasp.

        In the first step of a new period, the messages of the previous period are appended to `messages` first.
        """
        period = int((time_s - _ROUNDING_S) * self._settings.message_hz)
        if period > self._period:
            self.send()
            self._period = period
        bodies = self._body[np.asarray(data.contact.geom, dtype=np.int64).reshape(-1, 2)]
        rows: dict[tuple[int, int], list[int]] = {}
        # Contacts with at least one board; efc_address is -1 for a contact without a force.
        for index in np.flatnonzero((np.asarray(data.contact.efc_address) >= 0) & (bodies >= 0).any(axis=1)).tolist():
            pair = (int(bodies[index, 0]), int(bodies[index, 1]))
            if not (self._settings.first_entries_only and frozenset(pair) in self._seen):
                rows.setdefault(pair, []).append(index)
        for pair, indices in rows.items():
            self._seen.add(frozenset(pair))
            self._entries.append(self._read_entry(data, pair, indices))

    def _read_entry(self, data: mujoco.MjData, pair: tuple[int, int], indices: list[int]) -> PairEntry:
        """Read the contact points `indices` (in MuJoCo's list) of a pair of bodies; tips replace them if a tip touches.

        The sum of the forces is then divided equally among the touching tips.
        """
        force, wrench = np.zeros(len(indices)), np.zeros(6)
        for row, index in enumerate(indices):
            mujoco.mj_contactForce(self._scene.model, data, index, wrench)
            force[row] = np.linalg.norm(wrench[:3])
        for tips in self._settings.tips:
            if tips.board in pair and OBJECT in pair:
                position = self._find_touching_tips(data, tips)
                if len(position):
                    return PairEntry(pair, position, np.full(len(position), force.sum() / len(position)))
        return PairEntry(pair, data.contact.pos[indices].copy(), force)

    def _find_touching_tips(self, data: mujoco.MjData, tips: ContactTips) -> FloatArray:
        """Return the tips of a board that touch the object, f64[c, 3], metres, world; none if all are out of reach."""
        body = self._scene.board_bodies[tips.board]
        board = _make_body_pose(data, int(body)) @ self._scene.board_poses[tips.board]
        item = _make_body_pose(data, self._scene.model.body("object").id)
        position = apply(board, tips.position)
        distance = self._scene.grasp_object.shape.signed_distance(apply(inverse(item), position))
        touches = (distance <= distance.min() + tips.offset_m) & (distance.min() <= tips.reach_m)
        return np.asarray(position[touches])

    def send(self) -> None:
        """Append the messages of the present period, one for each board, and begin an empty period."""
        end_s = (self._period + 1) / self._settings.message_hz
        self.messages += make_messages(end_s, self._entries, range(len(self._scene.hand.boards)))
        self._entries, self._seen = [], set()


def _make_body_pose(data: mujoco.MjData, body: int) -> FloatArray:
    """Return the pose of a body in the world, f64[4, 4]."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return pose


def make_messages(time_s: float, entries: Iterable[PairEntry], boards: Iterable[int]) -> list[ContactMessage]:
    """Make one message for each board, with the entries of the pairs to which it belongs; time_s: end of the period."""
    entries = tuple(entries)
    return [ContactMessage(time_s, board, tuple(e for e in entries if board in e.bodies)) for board in boards]
