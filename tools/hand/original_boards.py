"""Board kinds of the original hand: electrode lines, spatial layout, squares over the taxels and bare sheet.

Facts: number, order, centre and normal of the taxels, and their positions in the original's heat maps. Assumed, because
no file contains it: the TX and RX line of each taxel, the size of the sheet, and the area that an electrode measures.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from original_figures import read_layout, read_taxels

from taxel.types import FloatArray, IndexArray

WINDOW_M: Final = 0.005
"""Side of the largest square that one taxel measures, metres: a pad of about 3 mm and 1 mm of fringe field beside it.
"""

MARGIN_M: Final = 0.0025
"""Width of the bare sheet around a board, metres (assumed: half a window)."""

SMALLEST_STRIP_M: Final = 0.0003
"""Bare sheet between two windows is described if it is wider, metres."""

GAPS: Final = {"palm": ((5,), (10,)), "fingertip": ((3,), ())}
"""Rows and columns of the heat map after which the sheet is interrupted: the next row or column is no neighbour."""


@dataclass(frozen=True)
class OriginalKind:
    """One board kind. Arrays have one row per taxel, in the order of the original message.

    tx, rx: assumed electrode lines. row, column: position on the unrolled sheet, seen from outside; row 0 is distal,
    column 0 is left. surface: f64[n, 11] as in the hand description. margin: f64[m, 11], rectangles of bare sheet.
    """

    name: str
    tx: IndexArray
    rx: IndexArray
    row: IndexArray
    column: IndexArray
    surface: FloatArray
    margin: FloatArray


def build_kind(name: str, finger_direction: FloatArray) -> OriginalKind:
    """Build a board kind from its extracted taxels.

    finger_direction: f64[3], unit vector to the distal end in the bracket's frame.
    """
    taxels = read_taxels(name)
    tx, rx = assign_lines(name)
    distal = _project(finger_direction, taxels[:, 3:])
    row, column = _orient_layout(name, taxels, distal)
    sheet = _Sheet(taxels[:, :3], taxels[:, 3:], distal, row, column)
    windows = np.minimum(sheet.spacing, WINDOW_M)
    surface = np.column_stack([taxels, distal, windows])
    return OriginalKind(name, tx, rx, row, column, surface, sheet.build_margin(windows))


def assign_lines(name: str) -> tuple[IndexArray, IndexArray]:
    """Return the assumed TX and RX line of each taxel, i64[n] each.

    With these lines, a scan (TX by TX) visits the taxels in the order of the original message.

    - Palm: two neighbouring columns of the heat map share a TX line. Even and odd columns have their own RX lines.
    - Other kinds: a row of the heat map is a TX line. Within a row, the RX lines follow the columns in the order of the
      message: from left to right on the proximal boards, otherwise from right to left.
    - medial_front and medial_back: the thesis lists fewer RX lines than the heat map has columns (Table 2.1: 8 x 4 for
      medial_front, 8 x 8 for medial_back). Therefore columns that never occur in the same row share an RX line.
    """
    if name == "palm":
        # 121 taxels: nine TX lines with 12 taxels each, then lines with 8 and 5 taxels
        index = np.arange(121)
        tx = np.where(index < 108, index // 12, np.where(index < 116, 9, 10))
        return tx, index - np.array([0, *range(12, 108, 12), 108, 116])[tx]
    layout = read_layout(name)
    index = np.arange(len(layout))
    if name == "thumb_medial_front":  # its indices are not in the order of the rows: first index of each row
        tx = np.searchsorted([6, 13, 20, 23, 26], index, side="right")
        return tx, index - np.array([0, 6, 13, 20, 23, 26])[tx]
    shared = {"medial_front": {0: 2, 1: 3, 5: 5}, "medial_back": {2: 3}}.get(name, {})
    rows = np.array([layout[i][0] for i in range(len(layout))])
    columns = np.array([shared.get(layout[i][1], layout[i][1]) for i in range(len(layout))])
    tx = np.searchsorted(np.unique(rows), rows)
    sign = 1 if name.startswith("proximal") else -1
    rx = np.searchsorted(np.unique(sign * columns), sign * columns)
    return tx, rx


@dataclass(frozen=True)
class _Sheet:
    """Unrolled sheet of one board. position, normal, distal: f64[n, 3]. row, column: of each taxel.

    spacing: f64[n, 2], distance to the neighbours in the distal and in the left direction, metres.
    """

    position: FloatArray
    normal: FloatArray
    distal: FloatArray
    row: IndexArray
    column: IndexArray
    index_of: dict[tuple[int, int], int] = field(init=False)
    spacing: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """Compute the index of the taxel at each (row, column), and the distances between neighbours."""
        index_of = {place: i for i, place in enumerate(zip(self.row.tolist(), self.column.tolist(), strict=True))}
        object.__setattr__(self, "index_of", index_of)
        object.__setattr__(self, "spacing", self._measure_spacing())

    def _find_neighbour(self, index: int, step: tuple[int, int]) -> int | None:
        """Return the index of the taxel at a step (rows, columns) from a taxel; None if there is none."""
        return self.index_of.get((int(self.row[index]) + step[0], int(self.column[index]) + step[1]))

    def _measure_spacing(self) -> FloatArray:
        """Return the distance of each taxel to its nearer neighbour in both directions, f64[n, 2], metres.

        A taxel without a neighbour in a direction gets the board's median.
        """
        spacing = np.full((len(self.position), 2), np.nan)
        for index in range(len(self.position)):
            for axis, steps in enumerate((((-1, 0), (1, 0)), ((0, -1), (0, 1)))):
                neighbours = [n for n in (self._find_neighbour(index, step) for step in steps) if n is not None]
                if neighbours:
                    distances = np.linalg.norm(self.position[neighbours] - self.position[index], axis=1)
                    spacing[index, axis] = distances.min()
        return np.where(np.isnan(spacing), np.nanmedian(spacing, axis=0), spacing)

    def build_margin(self, windows: FloatArray) -> FloatArray:
        """Build the rectangles f64[m, 11] of bare sheet: strips between two windows, and a margin around the board.

        A row contains centre, normal, distal direction and two sides. windows: f64[n, 2], sides of the squares that the
        taxels measure, metres. A strip in the distal direction is as wide as the spacing, so the corners between four
        windows are covered, too.
        """
        rows = []
        for index in range(len(self.position)):
            to_left = np.cross(self.normal[index], self.distal[index])
            for axis, (direction, step) in enumerate(((self.distal[index], (-1, 0)), (to_left, (0, -1)))):
                for sign in (1, -1):
                    neighbour = self._find_neighbour(index, (sign * step[0], sign * step[1]))
                    along = sign * direction
                    if neighbour is None:
                        rows.append(self._make_edge(index, axis, along, windows))
                    elif sign > 0:  # each pair of neighbours once
                        rows += self._make_strip(index, neighbour, axis, windows)
        return np.array(rows)

    def _make_edge(self, index: int, axis: int, along: FloatArray, windows: FloatArray) -> FloatArray:
        """Return the rectangle f64[11] of the margin beside a taxel without a neighbour in the direction `along`.

        axis: 0 for the distal, 1 for the left direction.
        """
        centre = self.position[index] + 0.5 * (windows[index, axis] + MARGIN_M) * along
        sides = self.spacing[index].copy()
        sides[1 - axis] = min(sides[1 - axis], 2.0 * WINDOW_M)
        sides[axis] = MARGIN_M
        return np.concatenate([centre, self.normal[index], self.distal[index], sides])

    def _make_strip(self, index: int, neighbour: int, axis: int, windows: FloatArray) -> list[FloatArray]:
        """Return the rectangle f64[11] of bare sheet between two neighbouring taxels, in a list; [] without space.

        The window of a taxel is the square that it measures. The rectangle contains centre, normal, distal direction
        and two sides. index, neighbour: the two taxels. axis: 0 if they are neighbours in the distal direction, 1 if
        they are neighbours in the left direction. windows: f64[n, 2], sides of the windows, metres. Across `axis`, a
        strip between distal neighbours is as long as the spacing, so that it covers the corners between four windows,
        too; other strips are as long as the windows.
        """
        pair = [index, neighbour]
        distance = float(np.linalg.norm(self.position[neighbour] - self.position[index]))
        width = distance - windows[pair, axis].mean()
        if width < SMALLEST_STRIP_M:
            return []
        normal = _normalise(self.normal[pair].sum(axis=0))
        distal = self.distal[pair].sum(axis=0)
        distal = _normalise(distal - normal * (normal @ distal))
        sides = np.empty(2)
        sides[axis] = width
        sides[1 - axis] = (self.spacing if axis == 0 else windows)[pair, 1 - axis].mean()
        return [np.concatenate([self.position[pair].mean(axis=0), normal, distal, sides])]


def _orient_layout(name: str, taxels: FloatArray, distal: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return the row and column i64[n] of each taxel from the heat map's rows and columns.

    Row 0 is distal and column 0 is left, seen from outside.
    """
    layout = read_layout(name)
    places = np.array([layout[i] for i in range(len(taxels))])
    # The sheet is interrupted at a gap: a skipped index there keeps the taxels on both sides from being neighbours.
    for axis, gaps in enumerate(GAPS.get(name, ((), ()))):
        for gap in sorted(gaps, reverse=True):
            places[places[:, axis] > gap, axis] += 1
    to_left = np.cross(taxels[:, 3:], distal)
    steps = np.array([_measure_step(taxels[:, :3], places, axis, (distal, to_left)) for axis in (0, 1)])
    if abs(steps[0, 0]) < abs(steps[0, 1]):  # the rows of the heat map run across the finger
        places, steps = places[:, ::-1], steps[::-1]
    rows = -places[:, 0] if steps[0, 0] > 0 else places[:, 0]
    columns = -places[:, 1] if steps[1, 1] > 0 else places[:, 1]
    return rows - rows.min(), columns - columns.min()


def _measure_step(
    position: FloatArray, places: IndexArray, axis: int, axes: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Return the median step from a taxel to its next neighbour along one axis of the heat map.

    The result f64[2] has the components in the distal and in the left direction, metres. places: i64[n, 2], row and
    column. axes: unit vectors of both directions, f64[n, 3] each.
    """
    index_of = {tuple(place): i for i, place in enumerate(places.tolist())}
    steps = []
    for place, index in index_of.items():
        following = list(place)
        following[axis] += 1
        neighbour = index_of.get(tuple(following))
        if neighbour is not None:
            difference = position[neighbour] - position[index]
            steps.append([difference @ direction[index] for direction in axes])
    return np.asarray(np.median(steps, axis=0))


def _project(direction: FloatArray, normals: FloatArray) -> FloatArray:
    """Return the direction f64[3] projected on the plane of each unit normal f64[n, 3], as unit vectors f64[n, 3]."""
    tangents = direction - normals * (normals @ direction)[:, None]
    return np.asarray(tangents / np.linalg.norm(tangents, axis=1, keepdims=True))


def _normalise(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))
