"""Board kinds and boards of a hand: TX and RX lines, the crossings that are taxels, and the unrolled sheet."""

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.hand.geometry import Surface
from taxel.hand.schema import DESCRIBED_LINES_MAX
from taxel_protocol.limits import CROSSING_MAP_SIZE, LINES_MAX, TAXELS_MAX

Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, eq=False)
class BoardKind:
    """Design of a sensor board, which several boards may share.

    Attributes:
        name: such as "palm".
        code: kind code that the board reports on I2C, 1..255.
        crossings: bool[tx_count, rx_count], true where a TX x RX crossing carries a taxel. Read-only.
        surface: taxel positions and normals; None if the description does not contain them.
        layout: i16[taxel_count, 2], row and column of each taxel on the unrolled sheet, seen from outside, row 0
            distal, column 0 left; neighbours on the sheet have adjacent places. None: its TX and RX line.

    Raises:
        ValueError: not 1..32 TX and RX lines, not 1..240 taxels, or a surface or layout with another number of taxels.
    """

    name: str
    code: int
    crossings: NDArray[np.bool_]
    surface: Surface | None = None
    layout: NDArray[np.int16] | None = None

    def __post_init__(self) -> None:
        """Raise ValueError unless lines, taxels, surface and layout of the kind agree; make `crossings` read-only."""
        crossings = np.array(self.crossings, dtype=np.bool_)
        if crossings.ndim != 2 or not all(1 <= n <= DESCRIBED_LINES_MAX for n in crossings.shape):
            raise ValueError(
                f"kind {self.name!r}: expected 1..{DESCRIBED_LINES_MAX} TX and RX lines, found {crossings.shape}"
            )
        if not 1 <= crossings.sum() <= TAXELS_MAX:
            raise ValueError(f"kind {self.name!r}: expected 1..{TAXELS_MAX} taxels, found {crossings.sum()}")
        if self.surface is not None and len(self.surface.position) != crossings.sum():
            raise ValueError(
                f"kind {self.name!r}: expected {crossings.sum()} surface rows, found {len(self.surface.position)}"
            )
        if self.layout is not None and self.layout.shape != (crossings.sum(), 2):
            raise ValueError(f"kind {self.name!r}: expected layout [{crossings.sum()}, 2], found {self.layout.shape}")
        object.__setattr__(self, "crossings", make_read_only(crossings))

    def __eq__(self, other: object) -> bool:
        """Return whether `other` is a board kind with the same name, code, surface, crossings and layout."""
        if not isinstance(other, BoardKind):
            return NotImplemented
        is_equal = (self.name, self.code, self.surface) == (other.name, other.code, other.surface)
        places = zip((self.row, self.column), (other.row, other.column), strict=True)
        return (
            is_equal
            and np.array_equal(self.crossings, other.crossings)
            and all(np.array_equal(mine, theirs) for mine, theirs in places)
        )

    def __hash__(self) -> int:
        return hash((self.name, self.code, self.crossings.shape, self.crossings.tobytes()))

    @property
    def tx_count(self) -> int:
        """Number of TX lines."""
        return int(self.crossings.shape[0])

    @property
    def rx_count(self) -> int:
        """Number of RX lines."""
        return int(self.crossings.shape[1])

    @cached_property
    def taxel_count(self) -> int:
        """Number of taxels."""
        return int(self.crossings.sum())

    @cached_property
    def tx(self) -> NDArray[np.uint8]:
        """TX line of each taxel, u8[taxel_count], row-major over the map."""
        return make_read_only(np.nonzero(self.crossings)[0].astype(np.uint8))

    @cached_property
    def rx(self) -> NDArray[np.uint8]:
        """RX line of each taxel, u8[taxel_count], row-major over the map."""
        return make_read_only(np.nonzero(self.crossings)[1].astype(np.uint8))

    @cached_property
    def row(self) -> NDArray[np.int16]:
        """Row of each taxel on the unrolled sheet, i16[taxel_count]; row 0 is distal."""
        return make_read_only(self.tx.astype(np.int16) if self.layout is None else self.layout[:, 0].copy())

    @cached_property
    def column(self) -> NDArray[np.int16]:
        """Column of each taxel on the unrolled sheet, i16[taxel_count]; column 0 is left, seen from outside."""
        return make_read_only(self.rx.astype(np.int16) if self.layout is None else self.layout[:, 1].copy())

    @property
    def layout_shape(self) -> tuple[int, int]:
        """Number of rows and columns of the taxels on the board's flat sheet (a bent board is unrolled).

        Without a layout, the TX lines are the rows, and the RX lines are the columns.
        """
        if self.layout is None:
            return self.tx_count, self.rx_count
        return int(self.row.max()) + 1, int(self.column.max()) + 1

    def crossing_bitmap(self) -> bytes:
        """Return the crossing map in the format of the board's register, 32 bytes.

        Bit number ``tx * rx_count + rx``, counted from the least significant bit of the first byte, is set for a taxel.
        Raises ValueError for more lines than the project's firmware supports.
        """
        if max(self.crossings.shape) > LINES_MAX:
            raise ValueError(
                f"kind {self.name!r}: the project's firmware supports {LINES_MAX} TX and {LINES_MAX} RX lines, "
                f"this kind has {self.tx_count} and {self.rx_count}; read its boards with protocol=original"
            )
        return self.pack_crossings()

    def pack_crossings(self) -> bytes:
        """Return the crossing map as `crossing_bitmap` does, also for boards whose firmware is not the project's.

        Raises ValueError for more than 256 crossings.
        """
        if self.crossings.size > 8 * CROSSING_MAP_SIZE:
            raise ValueError(
                f"kind {self.name!r}: a crossing map describes {8 * CROSSING_MAP_SIZE} crossings, "
                f"this kind has {self.tx_count} TX x {self.rx_count} RX lines"
            )
        return np.packbits(self.crossings.ravel(), bitorder="little").tobytes().ljust(CROSSING_MAP_SIZE, b"\0")


@dataclass(frozen=True, eq=False)
class Board:
    """One sensor board of a hand.

    Attributes:
        name: such as "fingertip_index".
        kind: design of the board.
        address: 7-bit I2C address.
        link_name: link of the robot that carries the bracket; None if not described.
        pose: frame of the bracket in that link, f64[4, 4]; None if not described.
        branch: name of the branch of the wiring that connects the board to the hub; None if not described.
    """

    name: str
    kind: BoardKind
    address: int
    link_name: str | None = None
    pose: NDArray[np.float64] | None = None
    branch: str | None = None

    def __eq__(self, other: object) -> bool:
        """Return whether `other` is a board with the same name, kind, address, link, branch and pose."""
        if not isinstance(other, Board):
            return NotImplemented
        fields = (self.name, self.kind, self.address, self.link_name, self.branch)
        return fields == (other.name, other.kind, other.address, other.link_name, other.branch) and np.array_equal(
            _get_array(self.pose), _get_array(other.pose)
        )

    def __hash__(self) -> int:
        return hash((self.name, self.kind, self.address, self.link_name))


def make_read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """Make an array read-only and return it."""
    array.setflags(write=False)
    return array


def _get_array(pose: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Return the pose, or an empty array for None, so that two optional poses can be compared."""
    return np.empty(0) if pose is None else pose
