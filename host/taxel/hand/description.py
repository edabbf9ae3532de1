"""Model of a hand: its boards and the order of all taxels.

This module defines the taxel order of the last axis of every array in the library: boards by address, and within a
board row-major over the crossing map (TX 0 first, and within a TX line RX 0 first).
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taxel.hand.boards import Board, Scalar, make_read_only
from taxel.hand.errors import HandGeometryError, UnknownBoardError, UnknownBranchError, format_address
from taxel.hand.geometry import REFERENCE_AREA_M2, Surface
from taxel.hand.wiring import Wiring


@dataclass(frozen=True)
class Hand:
    """Tactile skin: its boards and the order of all taxels.

    Attributes:
        name: such as "original".
        description: one line of text.
        pitch_m: distance between neighbouring taxel centres, metres.
        size_m: side of a square taxel, metres.
        boards: sorted by address.
        robot: name of the robot whose links carry the brackets (see `taxel.hand.robot`); None if not described.
        layer_m: thickness of the dielectric over the electrodes, metres; None if not described.
        wiring: electrical values of the branches of the wiring; None if no board has a branch.

    Raises:
        ValueError: no boards, or two boards with the same address or name.
    """

    name: str
    description: str
    pitch_m: float
    size_m: float
    boards: tuple[Board, ...]
    robot: str | None = None
    layer_m: float | None = None
    wiring: Wiring | None = None
    _slices: dict[int, slice] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Sort the boards by address, and compute each board's taxel slice.

        Raises ValueError if there is no board, or if two boards have the same address or name.
        """
        boards = tuple(sorted(self.boards, key=lambda board: board.address))
        for key in ("address", "name"):
            if not boards or len({getattr(board, key) for board in boards}) != len(boards):
                raise ValueError(f"hand {self.name!r}: expected at least one board and a unique {key} per board")
        ends = np.cumsum([board.kind.taxel_count for board in boards]).tolist()
        slices = {
            board.address: slice(end - board.kind.taxel_count, end) for board, end in zip(boards, ends, strict=True)
        }
        object.__setattr__(self, "boards", boards)
        object.__setattr__(self, "_slices", slices)

    @cached_property
    def n_taxels(self) -> int:
        """Number of taxels of all boards: the length of the last axis of every array."""
        return sum(board.kind.taxel_count for board in self.boards)

    @cached_property
    def sensor(self) -> NDArray[np.uint8]:
        """I2C address of the board of each taxel, u8[n_taxels]."""
        addresses = np.array([board.address for board in self.boards], dtype=np.uint8)
        return make_read_only(np.repeat(addresses, [board.kind.taxel_count for board in self.boards]))

    @cached_property
    def tx(self) -> NDArray[np.uint8]:
        """TX line of each taxel on its board, u8[n_taxels]."""
        return make_read_only(np.concatenate([board.kind.tx for board in self.boards]))

    @cached_property
    def rx(self) -> NDArray[np.uint8]:
        """RX line of each taxel on its board, u8[n_taxels]."""
        return make_read_only(np.concatenate([board.kind.rx for board in self.boards]))

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """Taxel centres in bracket frames, f64[n_taxels, 3], metres. Raises HandGeometryError if not described."""
        return make_read_only(np.concatenate([surface.position for surface in self._get_surfaces()]))

    @cached_property
    def normal(self) -> NDArray[np.float64]:
        """Outward unit normals in bracket frames, f64[n_taxels, 3]. Raises HandGeometryError if not described."""
        return make_read_only(np.concatenate([surface.normal for surface in self._get_surfaces()]))

    @cached_property
    def distal(self) -> NDArray[np.float64]:
        """Unit vectors along the electrode sides towards the distal end, in bracket frames, f64[n_taxels, 3]."""
        return make_read_only(np.concatenate([surface.distal for surface in self._get_surfaces()]))

    @cached_property
    def board_index(self) -> NDArray[np.intp]:
        """Index in `boards` of the board of each taxel, [n_taxels]."""
        return make_read_only(np.repeat(np.arange(len(self.boards)), [board.kind.taxel_count for board in self.boards]))

    @cached_property
    def square_size(self) -> NDArray[np.float64]:
        """Sides of the square that each taxel measures, along `distal` and across it, metres, f64[n_taxels, 2]."""
        return make_read_only(np.concatenate([surface.size for surface in self._get_surfaces()]))

    @cached_property
    def area_share(self) -> NDArray[np.float64]:
        """Area of each taxel's square divided by the area to which the force laws of the layer refer, f64[n_taxels]."""
        return make_read_only(np.prod(self.square_size, axis=1) / REFERENCE_AREA_M2)

    @cached_property
    def row(self) -> NDArray[np.int16]:
        """Row of each taxel on the unrolled sheet of its board, i16[n_taxels]."""
        return make_read_only(np.concatenate([board.kind.row for board in self.boards]))

    @cached_property
    def column(self) -> NDArray[np.int16]:
        """Column of each taxel on the unrolled sheet of its board, i16[n_taxels]."""
        return make_read_only(np.concatenate([board.kind.column for board in self.boards]))

    def _get_surfaces(self) -> list[Surface]:
        """Return the taxel positions and normals of each board. Raises HandGeometryError if a board has none."""
        surfaces = [board.kind.surface for board in self.boards if board.kind.surface is not None]
        if len(surfaces) != len(self.boards):
            raise HandGeometryError(self.name)
        return surfaces

    def get_board(self, address: int) -> Board:
        """Return the board at a 7-bit I2C address. Raises UnknownBoardError if there is none."""
        for board in self.boards:
            if board.address == address:
                return board
        raise UnknownBoardError(self.name, format_address(address), [format_address(b.address) for b in self.boards])

    def find_board(self, name: str) -> Board:
        """Return the board with this name. Raises UnknownBoardError if there is none."""
        for board in self.boards:
            if board.name == name:
                return board
        raise UnknownBoardError(self.name, repr(name), [board.name for board in self.boards])

    def find_branch(self, name: str) -> tuple[Board, ...]:
        """Return the boards of a branch of the wiring, sorted by address. Raises UnknownBranchError without any."""
        boards = tuple(board for board in self.boards if board.branch == name)
        if not boards:
            raise UnknownBranchError(self.name, name, self.branches)
        return boards

    @property
    def branches(self) -> list[str]:
        """Names of the branches of the wiring, sorted; empty if no board has a branch."""
        return sorted({board.branch for board in self.boards if board.branch is not None})

    def get_slice(self, address: int) -> slice:
        """Return the slice of a board on the taxel axis. Raises UnknownBoardError if there is no such board."""
        return self._slices[self.get_board(address).address]

    def split(self, counts: NDArray[Scalar]) -> dict[int, NDArray[Scalar]]:
        """Divide an array by board.

        Args:
            counts: array with the taxel axis last, [..., n_taxels].

        Returns:
            A view [..., taxel_count of the board] per address, in the order of addresses.

        Raises:
            ValueError: the last axis has another length.
        """
        if counts.ndim == 0 or counts.shape[-1] != self.n_taxels:
            raise ValueError(
                f"hand {self.name!r}: expected an array with {self.n_taxels} taxels on its last axis, "
                f"found shape {counts.shape}; use the hand description of the recording"
            )
        return {address: counts[..., part] for address, part in self._slices.items()}
