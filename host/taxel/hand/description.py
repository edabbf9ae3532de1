"""Model of a hand: its boards, their kinds, and the TX x RX crossings that are taxels; loaded from a description file.

This module defines the taxel order of the last axis of every array in the library: boards by address, and within a
board row-major over the crossing map (TX 0 first, and within a TX line RX 0 first).
"""

import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import resources
from importlib.resources.abc import Traversable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.hand.crossings import parse_crossings, parse_layout
from taxel.hand.errors import HandGeometryError, UnknownBoardError, format_address, format_path
from taxel.hand.geometry import REFERENCE_AREA_M2, Surface, build_surface
from taxel.hand.schema import DESCRIBED_LINES_MAX, BoardTable, HandDocument, parse_hand
from taxel.hand.toml_text import read_description
from taxel.hand.transforms import make_pose
from taxel_protocol.limits import CROSSING_MAP_SIZE, LINES_MAX, TAXELS_MAX

_SUFFIX = ".toml"

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
        """Check the numbers of lines, taxels and surface rows of the board kind; make `crossings` read-only."""
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
        object.__setattr__(self, "crossings", _make_read_only(crossings))

    def __eq__(self, other: object) -> bool:
        """Whether `other` is a board kind with the same name, code, surface and crossings."""
        if not isinstance(other, BoardKind):
            return NotImplemented
        is_equal = (self.name, self.code, self.surface) == (other.name, other.code, other.surface)
        places = zip((self.row, self.column), (other.row, other.column), strict=True)
        return (
            is_equal
            and np.array_equal(self.crossings, other.crossings)
            and all(np.array_equal(own, others) for own, others in places)
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
        return _make_read_only(np.nonzero(self.crossings)[0].astype(np.uint8))

    @cached_property
    def rx(self) -> NDArray[np.uint8]:
        """RX line of each taxel, u8[taxel_count], row-major over the map."""
        return _make_read_only(np.nonzero(self.crossings)[1].astype(np.uint8))

    @cached_property
    def row(self) -> NDArray[np.int16]:
        """Row of each taxel on the unrolled sheet, i16[taxel_count]; row 0 is distal."""
        return _make_read_only(self.tx.astype(np.int16) if self.layout is None else self.layout[:, 0].copy())

    @cached_property
    def column(self) -> NDArray[np.int16]:
        """Column of each taxel on the unrolled sheet, i16[taxel_count]; column 0 is left, seen from outside."""
        return _make_read_only(self.rx.astype(np.int16) if self.layout is None else self.layout[:, 1].copy())

    @property
    def layout_shape(self) -> tuple[int, int]:
        """Number of rows and columns of the unrolled sheet."""
        if self.layout is None:
            return self.tx_count, self.rx_count
        return int(self.row.max()) + 1, int(self.column.max()) + 1

    def crossing_bitmap(self) -> bytes:
        """Return the crossing map in the format of the board's register, 32 bytes.

        Bit ``tx * rx_count + rx``, least significant bit of the first byte first; unused bits are zero. Raises
        ValueError for more lines than the register describes.
        """
        if max(self.crossings.shape) > LINES_MAX:
            raise ValueError(
                f"kind {self.name!r}: the project's firmware supports {LINES_MAX} TX and {LINES_MAX} RX lines, "
                f"this kind has {self.tx_count} and {self.rx_count}; read its boards with protocol=original"
            )
        return self.pack_crossings()

    def pack_crossings(self) -> bytes:
        """Return the crossing map as `crossing_bitmap` does, also for boards that run other firmware.

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
    """

    name: str
    kind: BoardKind
    address: int
    link_name: str | None = None
    pose: NDArray[np.float64] | None = None

    def __eq__(self, other: object) -> bool:
        """Whether `other` is a board with the same name, kind, address, link and pose."""
        if not isinstance(other, Board):
            return NotImplemented
        own = (self.name, self.kind, self.address, self.link_name)
        return own == (other.name, other.kind, other.address, other.link_name) and np.array_equal(
            _get_array(self.pose), _get_array(other.pose)
        )

    def __hash__(self) -> int:
        return hash((self.name, self.kind, self.address, self.link_name))


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
    _slices: dict[int, slice] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Sort the boards by address, check that addresses and names are unique; compute each board's taxel slice."""
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
        return _make_read_only(np.repeat(addresses, [board.kind.taxel_count for board in self.boards]))

    @cached_property
    def tx(self) -> NDArray[np.uint8]:
        """TX line of each taxel on its board, u8[n_taxels]."""
        return _make_read_only(np.concatenate([board.kind.tx for board in self.boards]))

    @cached_property
    def rx(self) -> NDArray[np.uint8]:
        """RX line of each taxel on its board, u8[n_taxels]."""
        return _make_read_only(np.concatenate([board.kind.rx for board in self.boards]))

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """Taxel centres in bracket frames, f64[n_taxels, 3], metres. Raises HandGeometryError if not described."""
        return _make_read_only(np.concatenate([surface.position for surface in self._get_surfaces()]))

    @cached_property
    def normal(self) -> NDArray[np.float64]:
        """Outward unit normals in bracket frames, f64[n_taxels, 3]. Raises HandGeometryError if not described."""
        return _make_read_only(np.concatenate([surface.normal for surface in self._get_surfaces()]))

    @cached_property
    def distal(self) -> NDArray[np.float64]:
        """Unit vectors along the electrode sides towards the distal end, in bracket frames, f64[n_taxels, 3]."""
        return _make_read_only(np.concatenate([surface.distal for surface in self._get_surfaces()]))

    @cached_property
    def board_index(self) -> NDArray[np.intp]:
        """Index in `boards` of the board of each taxel, [n_taxels]."""
        return _make_read_only(
            np.repeat(np.arange(len(self.boards)), [board.kind.taxel_count for board in self.boards])
        )

    @cached_property
    def square_size(self) -> NDArray[np.float64]:
        """Sides of the square that each taxel measures, along `distal` and across it, metres, f64[n_taxels, 2]."""
        return _make_read_only(np.concatenate([surface.size for surface in self._get_surfaces()]))

    @cached_property
    def area_share(self) -> NDArray[np.float64]:
        """Area of each taxel's square divided by the area to which the force laws of the layer refer, f64[n_taxels]."""
        return _make_read_only(np.prod(self.square_size, axis=1) / REFERENCE_AREA_M2)

    @cached_property
    def row(self) -> NDArray[np.int16]:
        """Row of each taxel on the unrolled sheet of its board, i16[n_taxels]."""
        return _make_read_only(np.concatenate([board.kind.row for board in self.boards]))

    @cached_property
    def column(self) -> NDArray[np.int16]:
        """Column of each taxel on the unrolled sheet of its board, i16[n_taxels]."""
        return _make_read_only(np.concatenate([board.kind.column for board in self.boards]))

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


def list_packaged_hands() -> list[str]:
    """List the names of the packaged hand descriptions, sorted."""
    return sorted(
        entry.name.removesuffix(_SUFFIX)
        for entry in _get_description_folder().iterdir()
        if entry.name.endswith(_SUFFIX)
    )


def load_hand(name_or_path: str | os.PathLike[str]) -> Hand:
    """Load a hand description.

    Args:
        name_or_path: a packaged name ("original", "flat8") or a path to a TOML file.

    Raises:
        HandDescriptionError: unknown name, missing or unreadable file, or an error in the file.
    """
    if name_or_path in list_packaged_hands():
        file = f"{name_or_path}{_SUFFIX}"
        return _build_hand(parse_hand(_get_description_folder().joinpath(file).read_bytes(), file))
    file = format_path(os.fspath(name_or_path))
    return _build_hand(parse_hand(read_description(name_or_path, "hand", list_packaged_hands()), file))


def parse_hand_description(data: bytes, file: str) -> Hand:
    """Build the hand of the bytes of a description file. `file`: file name in error messages.

    Raises HandDescriptionError for an error in the description.
    """
    return _build_hand(parse_hand(data, format_path(file)))


def read_hand_text(hand: Hand | str | os.PathLike[str]) -> str | None:
    """Read the text of the description file of a hand.

    hand: a packaged name, a path, or a `Hand` that equals a packaged one. Returns None for any other `Hand`, which has
    no file. Raises HandDescriptionError as `load_hand` does.
    """
    if isinstance(hand, Hand):
        if hand.name not in list_packaged_hands() or load_hand(hand.name) != hand:
            return None
        hand = hand.name
    if hand in list_packaged_hands():
        return _get_description_folder().joinpath(f"{hand}{_SUFFIX}").read_text()
    return read_description(hand, "hand", list_packaged_hands()).decode(errors="replace")


def _build_hand(document: HandDocument) -> Hand:
    """Build the Hand object from a hand description that has been parsed and checked."""
    geometry = document.get("geometry", {})
    kinds = {}
    for name, table in document["kinds"].items():
        kind = BoardKind(name, table["code"], parse_crossings(table["crossings"]))
        if name in geometry:
            if "layout" in geometry[name]:
                kind = replace(kind, layout=parse_layout(geometry[name]["layout"]))
            rows = np.array(geometry[name]["taxels"], dtype=np.float64)
            margin = np.array(geometry[name]["margin"], dtype=np.float64) if "margin" in geometry[name] else None
            surface = build_surface(rows, kind.row, kind.column, float(document["taxel"]["pitch_m"]), margin)
            kind = replace(kind, surface=surface)
        kinds[name] = kind
    return Hand(
        document["name"],
        document["description"],
        float(document["taxel"]["pitch_m"]),
        float(document["taxel"]["size_m"]),
        tuple(_build_board(board, kinds[board["kind"]]) for board in document["boards"]),
        document.get("robot"),
        document["taxel"].get("layer_m"),
    )


def _build_board(table: BoardTable, kind: BoardKind) -> Board:
    """Build a board of the given kind from its checked table in the hand description."""
    if "link" not in table:
        return Board(table["name"], kind, table["address"])
    bracket_pose = make_pose(np.array(table["position_m"], float), np.array(table["quaternion_wxyz"], float))
    return Board(table["name"], kind, table["address"], table["link"], _make_read_only(bracket_pose))


def _get_description_folder() -> Traversable:
    """Return the folder of the packaged hand descriptions."""
    return resources.files("taxel.hand").joinpath("descriptions")


def _get_array(pose: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Return the pose, or an empty array for None, so that two optional poses can be compared."""
    return np.empty(0) if pose is None else pose


def _make_read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """Make an array read-only and return it."""
    array.setflags(write=False)
    return array
