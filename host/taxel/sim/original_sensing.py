"""The contact plug-in of the original simulator: which contact points activate which taxels.

Each board keeps the contact points of the last message of its contact sensor that was not empty. When the plug-in
saves, every taxel of the board nearer than a threshold to one of these points is active; its force is the largest force
among these points. Each rule can be changed by a field of `OriginalRules`, so that its effect can be measured.

Source: the contact plug-in of the public repository abed-almrad/BICI_SENSORS_ROS (2023-05-02);
docs/original-simulator.md.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from taxel.hand import Hand
from taxel.hand.original.centres import PluginCoordinates, get_plugin_coordinates, load_coded_centres
from taxel.hand.transforms import apply
from taxel.sim.contact_messages import OBJECT, ContactMessage, ContactTips, PairEntry, RecorderSettings
from taxel.types import FloatArray

PALM_BOARD: Final = "palm"
"""Name of the board whose collision mesh has a tip over each taxel in the original simulation."""

THRESHOLD_HISTORY_M: Final[Mapping[str, float]] = MappingProxyType(
    {
        "first": 0.100,
        "half_diagonal": 0.00212,
        "half_diagonal_wrong_unit": 0.212,
        "all": 1.0,
        "winter_2022": 0.00512,
        "final": 0.00234,
    }
)
"""Thresholds of the plug-in in the order of its history, metres. half_diagonal: half the diagonal of a pad of 3 mm by
3 mm. winter_2022: November and December 2022. final: that of the final recordings.
"""

THRESHOLD_M: Final = THRESHOLD_HISTORY_M["final"]
"""Distance from taxel centre to contact point below which the taxel is active, metres: 2.34 mm. A larger value
activates more taxels.
"""

PALM_TIPS_M: Final = 0.0005
"""Height of the tips over the pads of the palm in the original collision mesh, metres. Fingers have no tips."""

TIP_OFFSET_M: Final = 0.0002
"""Tips at most this much farther from the object than the nearest tip touch as well, metres (assumed: contact margin of
the engine). A larger value gives more contact points on the palm.
"""


PAD_M: Final = (0.0033, 0.0028)
"""Sides of a pad along and across the finger, metres; the mesh of a board has a vertex at each of its corners. Source:
pads of the finger boards, 3.2 to 3.4 mm by 2.8 mm.
"""

OVERLAP_M: Final = 0.0005
"""Depth to which the bodies of the original engine overlap, metres. Its contact surface layer permits 1 mm; 95 % of the
recorded contact points around a cylinder are within 0.54 mm of its surface. A larger value gives more contact points.
"""

REACH_M: Final = 0.001
"""Largest distance of a pad's corner from the object at which it touches, metres: the contact surface layer of the
original engine. A smaller value leaves more contacts to the points of the present engine.
"""


@dataclass(frozen=True)
class OriginalRules:
    """Rules of the original simulator. The default is the original; each field changes one rule.

    Attributes:
        stale_contacts: a board keeps its contact points until the next message with contacts; False: a message without
            contacts clears them.
        any_partner: contacts with any body are used, also with other parts of the hand; False: with the object only.
        first_entry_only: only the first entry of each pair of bodies in a message is used; False: all entries.
        last_name_wins: all points of a message belong to the board that the last pair names; False: to the board
            of the sensor.
        coded_centres: taxel centres as the plug-in contains them (fingers turned by 5 degrees); False: true centres.
        threshold_m: distance to a contact point below which a taxel is active; at the threshold it is inactive.
        palm_tips_m: height of the tips over the palm's taxels; 0: no tips. The fingers have none.
        overlap_m: a board without tips that touches the object reports the corners of all pads that are at most this
            much farther from the object than the nearest corner; 0: the few points that the present engine reports.
        boards_without_coordinates: the boards without coordinates in the plug-in sense nothing but a contact at the
            origin of their bracket (or nothing at all); False: every board has coordinates.
    """

    stale_contacts: bool = True
    any_partner: bool = True
    first_entry_only: bool = True
    last_name_wins: bool = True
    coded_centres: bool = True
    threshold_m: float = THRESHOLD_M
    palm_tips_m: float = PALM_TIPS_M
    overlap_m: float = OVERLAP_M
    boards_without_coordinates: bool = True

    def __post_init__(self) -> None:
        """Raise ValueError unless all distances are finite, the threshold is above 0 and the others are at least 0."""
        if not (np.isfinite(self.threshold_m) and self.threshold_m > 0):
            raise ValueError(f"threshold_m: expected metres above 0, found {self.threshold_m}")
        if not (np.isfinite(self.palm_tips_m) and self.palm_tips_m >= 0):
            raise ValueError(f"palm_tips_m: expected metres of at least 0, found {self.palm_tips_m}")
        if not (np.isfinite(self.overlap_m) and self.overlap_m >= 0):
            raise ValueError(f"overlap_m: expected metres of at least 0, found {self.overlap_m}")


class StoredPoints(NamedTuple):
    """Contact points that one board keeps. position: f64[c, 3], metres, world. force_n: f64[c], newtons."""

    position: FloatArray
    force_n: FloatArray


_NO_POINTS: Final = StoredPoints(np.zeros((0, 3)), np.zeros(0))


class ContactMemory:
    """Contact points that each board keeps while messages arrive."""

    def __init__(self, rules: OriginalRules) -> None:
        """Create the memory of boards that have received no message."""
        self.rules = rules
        self._points: dict[int, StoredPoints] = {}

    def receive(self, message: ContactMessage) -> None:
        """Replace the contact points of a board with those of a message, according to `rules`.

        Contacts without the object count only if `rules.any_partner` is True. A message without a contact that counts
        changes nothing, or clears the board's points if `rules.stale_contacts` is False.
        """
        entries = [entry for entry in message.entries if self.rules.any_partner or OBJECT in entry.bodies]
        if self.rules.first_entry_only:
            entries = _keep_first_entries(entries)
        if not entries:
            if not self.rules.stale_contacts:
                self._points.pop(message.board, None)
            return
        name = _find_last_name(entries, message.board) if self.rules.last_name_wins else message.board
        self._points[name] = StoredPoints(
            np.concatenate([entry.position for entry in entries]), np.concatenate([entry.force_n for entry in entries])
        )

    def get_points(self, board: int) -> StoredPoints:
        """Return the contact points that a board keeps. board: index in `hand.boards`."""
        return self._points.get(board, _NO_POINTS)


def _keep_first_entries(entries: Iterable[PairEntry]) -> list[PairEntry]:
    """Return the first entry of each pair of bodies; the order of the two bodies does not matter."""
    first: dict[frozenset[int], PairEntry] = {}
    for entry in entries:
        first.setdefault(frozenset(entry.bodies), entry)
    return list(first.values())


def _find_last_name(entries: Sequence[PairEntry], sensor: int) -> int:
    """Return the board under whose name the plug-in stores a message, as an index in `hand.boards`.

    The last pair of bodies that contains a board determines the result: its first body that is a board (index 0 or
    more). Without such a pair, the result is `sensor`, the board of the contact sensor.
    """
    name = sensor
    for first, second in (entry.bodies for entry in entries):
        if first >= 0:
            name = first
        elif second >= 0:
            name = second
    return name


def get_centres(hand: Hand, rules: OriginalRules) -> FloatArray:
    """Return the taxel centres that the original contact plug-in uses, f64[n, 3], metres, in the brackets' frames.

    The centre of a taxel for which the plug-in has no coordinates is NaN. Raises NoCodedCentresError if a rule of the
    original hand is on and `hand` is another hand.
    """
    centres = hand.position.copy()
    if rules.coded_centres:
        coded = load_coded_centres(hand)
        centres = np.where(np.isfinite(coded), coded, centres)
    if rules.boards_without_coordinates:
        for board, coordinates in zip(hand.boards, get_plugin_coordinates(hand), strict=True):
            if coordinates is not PluginCoordinates.CODED:
                centres[hand.get_slice(board.address)] = 0.0 if coordinates is PluginCoordinates.ORIGIN else np.nan
    return centres


def find_active(centres: FloatArray, points: StoredPoints, threshold_m: float) -> tuple[NDArray[np.bool_], FloatArray]:
    """Find the active taxels of one board: bool[n], and their forces f64[n], newtons.

    centres: f64[n, 3], metres, in the frame of the points; a taxel with NaN is never active. A taxel is active if its
    distance to a point is below the threshold, and its force is the largest force of these points, 0 if it is inactive.
    Of taxels with equal centres only the first can be active, since the plug-in compares positions to list each taxel
    once.
    """
    active, force = np.zeros(len(centres), dtype=bool), np.zeros(len(centres))
    rows = np.flatnonzero(np.isfinite(centres).all(axis=1))
    if len(rows) == 0 or len(points.position) == 0:
        return active, force
    _, first = np.unique(centres[rows], axis=0, return_index=True)
    rows = rows[np.sort(first)]
    is_near = cdist(centres[rows], points.position) < threshold_m
    active[rows] = is_near.any(axis=1)
    force[rows] = np.where(is_near, points.force_n, 0.0).max(axis=1)
    return active, force


class OriginalContact(NamedTuple):
    """Result of the plug-in for T saving times: active bool[T, n], force_n f64[T, n] in newtons."""

    active: NDArray[np.bool_]
    force_n: FloatArray


def sense_messages(
    hand: Hand, sensor_poses: FloatArray, time_s: FloatArray, messages: Iterable[ContactMessage], rules: OriginalRules
) -> OriginalContact:
    """Compute the taxels that the original contact plug-in would save as active at each time of `time_s`.

    sensor_poses: f64[T, s, 4, 4], brackets in the world. time_s: f64[T], ascending. messages: in ascending order of
    time; a message that ends after a sample does not act on it.
    """
    centres = get_centres(hand, rules)
    shape = (len(time_s), hand.n_taxels)
    result = OriginalContact(np.zeros(shape, dtype=bool), np.zeros(shape))
    memory, pending = ContactMemory(rules), list(messages)
    position = 0
    for sample, time in enumerate(time_s.tolist()):
        while position < len(pending) and pending[position].time_s <= time + 1e-9:
            memory.receive(pending[position])
            position += 1
        for index, board in enumerate(hand.boards):
            points = memory.get_points(index)
            if len(points.position):
                where = hand.get_slice(board.address)
                placed = apply(sensor_poses[sample, index], centres[where])
                result.active[sample, where], result.force_n[sample, where] = find_active(
                    placed, points, rules.threshold_m
                )
    return result


def make_recorder_settings(hand: Hand, rules: OriginalRules) -> RecorderSettings:
    """Make the settings of the simulated contact sensors, with the points at which each board can touch the object.

    The points are tips over the taxels of the palm, and the corners of the pads on all other boards.
    """
    tips = []
    for index, board in enumerate(hand.boards):
        where = hand.get_slice(board.address)
        if rules.palm_tips_m > 0 and board.name == PALM_BOARD:
            position = hand.position[where] + rules.palm_tips_m * hand.normal[where]
            tips.append(ContactTips(index, position, TIP_OFFSET_M))
        elif rules.overlap_m > 0:
            corners = find_pad_corners(hand.position[where], hand.normal[where], hand.distal[where])
            tips.append(ContactTips(index, corners, rules.overlap_m, REACH_M))
    return RecorderSettings(first_entries_only=rules.first_entry_only, tips=tuple(tips))


def find_pad_corners(position: FloatArray, normal: FloatArray, distal: FloatArray) -> FloatArray:
    """Find the corners of pads, f64[4 n, 3], metres. position, normal, distal: f64[n, 3] of the n taxels."""
    along, across = 0.5 * PAD_M[0] * distal, 0.5 * PAD_M[1] * np.cross(normal, distal)
    return np.concatenate([position + i * along + k * across for i in (-1, 1) for k in (-1, 1)])


def get_surface_heights(hand: Hand, rules: OriginalRules) -> dict[str, float]:
    """Return the height of the rigid surface over the electrodes by board name, metres: 0 except on the palm."""
    return {board.name: rules.palm_tips_m if board.name == PALM_BOARD else 0.0 for board in hand.boards}
