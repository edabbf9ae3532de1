"""What a hand is made of: its boards, their kinds, and which TX x RX crossings are taxels.

The description file gives this; no shape is written in code. The order of taxels set here is the order of
the last axis of every array in the library: boards by address, and on a board row-major over the crossing
map (TX 0 first, and on a TX line RX 0 first).
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib import resources
from importlib.resources.abc import Traversable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.hand.crossings import parse_crossings
from taxel.hand.errors import HandGeometryError, UnknownBoardError, format_address, format_path
from taxel.hand.geometry import Surface, build_surface
from taxel.hand.schema import BoardTable, HandDocument, parse_hand
from taxel.hand.toml_text import read_description
from taxel.hand.transforms import make_pose
from taxel_protocol.limits import CROSSING_MAP_SIZE, LINES_MAX, TAXELS_MAX

_SUFFIX = ".toml"

Scalar = TypeVar("Scalar", bound=np.generic)


@dataclass(frozen=True, eq=False)
class BoardKind:
    """One design of a sensor board; several boards may share it.

    Attributes:
        name: such as "palm".
        code: kind code that a board reports on I2C, 1..255.
        crossings: bool[tx_count, rx_count], true where a TX x RX crossing carries a taxel. Read-only.
        surface: where its taxels are; None if the description does not say.

    Raises:
        ValueError: not 1..16 lines each way, not 1..240 taxels, or a surface of another number of taxels.
    """

    name: str
    code: int
    crossings: NDArray[np.bool_]
    surface: Surface | None = None

    def __post_init__(self) -> None:
        crossings = np.array(self.crossings, dtype=np.bool_)
        if crossings.ndim != 2 or not all(1 <= lines <= LINES_MAX for lines in crossings.shape):
            raise ValueError(f"kind {self.name!r}: expected 1..{LINES_MAX} TX and RX lines, found {crossings.shape}")
        if not 1 <= crossings.sum() <= TAXELS_MAX:
            raise ValueError(f"kind {self.name!r}: expected 1..{TAXELS_MAX} taxels, found {crossings.sum()}")
        if self.surface is not None and len(self.surface.position) != crossings.sum():
            raise ValueError(f"kind {self.name!r}: {crossings.sum()} taxels, surface of {len(self.surface.position)}")
        object.__setattr__(self, "crossings", _read_only(crossings))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, BoardKind):
            return NotImplemented
        same = (self.name, self.code, self.surface) == (other.name, other.code, other.surface)
        return same and np.array_equal(self.crossings, other.crossings)

    def __hash__(self) -> int:
        return hash((self.name, self.code, self.crossings.shape, self.crossing_bitmap()))

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
        return _read_only(np.nonzero(self.crossings)[0].astype(np.uint8))

    @cached_property
    def rx(self) -> NDArray[np.uint8]:
        """RX line of each taxel, u8[taxel_count], row-major over the map."""
        return _read_only(np.nonzero(self.crossings)[1].astype(np.uint8))

    def crossing_bitmap(self) -> bytes:
        """The crossings as a board stores them: 32 bytes.

        Bit ``tx * rx_count + rx``, least significant bit of the first byte first; unused bits are zero.
        """
        return np.packbits(self.crossings.ravel(), bitorder="little").tobytes().ljust(CROSSING_MAP_SIZE, b"\0")


@dataclass(frozen=True, eq=False)
class Board:
    """One sensor board of a hand.

    Attributes:
        name: such as "fingertip_index".
        kind: its design.
        address: 7-bit I2C address.
        link: link of the robot that its bracket is fixed to; None if the description does not say.
        pose: the bracket's frame in that link, f64[4, 4]; None as above.
    """

    name: str
    kind: BoardKind
    address: int
    link: str | None = None
    pose: NDArray[np.float64] | None = None

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Board):
            return NotImplemented
        same = (self.name, self.kind, self.address, self.link) == (other.name, other.kind, other.address, other.link)
        return same and np.array_equal(_or_empty(self.pose), _or_empty(other.pose))

    def __hash__(self) -> int:
        return hash((self.name, self.kind, self.address, self.link))


@dataclass(frozen=True)
class Hand:
    """A tactile skin: its boards and the order of all its taxels.

    Attributes:
        name: such as "allegro".
        description: one line for people.
        pitch_m: distance between neighbouring taxel centres, metres.
        size_m: side of a square taxel, metres.
        boards: in the order of their addresses, whatever order they were given in.
        robot: name of the robot whose links carry the brackets (see `taxel.hand.robot`); None if not known.
        layer_m: thickness of the dielectric over the electrodes, metres; None if not known.

    Raises:
        ValueError: no boards, or two with one address or one name.
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
        boards = tuple(sorted(self.boards, key=lambda board: board.address))
        for key in ("address", "name"):
            if not boards or len({getattr(board, key) for board in boards}) != len(boards):
                raise ValueError(f"hand {self.name!r}: expected boards, each with its own {key}")
        ends = np.cumsum([board.kind.taxel_count for board in boards]).tolist()
        slices = {
            board.address: slice(end - board.kind.taxel_count, end) for board, end in zip(boards, ends, strict=True)
        }
        object.__setattr__(self, "boards", boards)
        object.__setattr__(self, "_slices", slices)

    @cached_property
    def n_taxels(self) -> int:
        """Number of taxels, all boards together: the length of every array's last axis."""
        return sum(board.kind.taxel_count for board in self.boards)

    @cached_property
    def sensor(self) -> NDArray[np.uint8]:
        """I2C address of the board each taxel belongs to, u8[n_taxels]."""
        addresses = np.array([board.address for board in self.boards], dtype=np.uint8)
        return _read_only(np.repeat(addresses, [board.kind.taxel_count for board in self.boards]))

    @cached_property
    def tx(self) -> NDArray[np.uint8]:
        """TX line of each taxel on its board, u8[n_taxels]."""
        return _read_only(np.concatenate([board.kind.tx for board in self.boards]))

    @cached_property
    def rx(self) -> NDArray[np.uint8]:
        """RX line of each taxel on its board, u8[n_taxels]."""
        return _read_only(np.concatenate([board.kind.rx for board in self.boards]))

    @cached_property
    def position(self) -> NDArray[np.float64]:
        """Taxel centres in their bracket frames, f64[n_taxels, 3], metres; HandGeometryError if not described."""
        return _read_only(np.concatenate([surface.position for surface in self._surfaces()]))

    @cached_property
    def normal(self) -> NDArray[np.float64]:
        """Outward unit normals in their bracket frames, f64[n_taxels, 3]; HandGeometryError if not described."""
        return _read_only(np.concatenate([surface.normal for surface in self._surfaces()]))

    @cached_property
    def distal(self) -> NDArray[np.float64]:
        """Unit vectors along the electrodes' sides to the distal end, bracket frames, f64[n_taxels, 3]."""
        return _read_only(np.concatenate([surface.distal for surface in self._surfaces()]))

    @cached_property
    def board_index(self) -> NDArray[np.intp]:
        """Index in `boards` of the board each taxel belongs to, [n_taxels]."""
        return _read_only(np.repeat(np.arange(len(self.boards)), [board.kind.taxel_count for board in self.boards]))

    def _surfaces(self) -> list[Surface]:
        surfaces = [board.kind.surface for board in self.boards if board.kind.surface is not None]
        if len(surfaces) != len(self.boards):
            raise HandGeometryError(self.name)
        return surfaces

    def get_board(self, address: int) -> Board:
        """The board at a 7-bit I2C address; UnknownBoardError if there is none."""
        for board in self.boards:
            if board.address == address:
                return board
        raise UnknownBoardError(self.name, format_address(address), [format_address(b.address) for b in self.boards])

    def find_board(self, name: str) -> Board:
        """The board of that name; UnknownBoardError if there is none."""
        for board in self.boards:
            if board.name == name:
                return board
        raise UnknownBoardError(self.name, repr(name), [board.name for board in self.boards])

    def get_slice(self, address: int) -> slice:
        """Where a board's taxels lie on the taxel axis; UnknownBoardError if the hand has no such board."""
        return self._slices[self.get_board(address).address]

    def split(self, counts: NDArray[Scalar]) -> dict[int, NDArray[Scalar]]:
        """Divide an array by board.

        Args:
            counts: any array whose last axis is the taxel axis, [..., n_taxels].

        Returns:
            For each address, in order, a view [..., taxel_count of that board].

        Raises:
            ValueError: the last axis has another length.
        """
        if counts.ndim == 0 or counts.shape[-1] != self.n_taxels:
            raise ValueError(
                f"hand {self.name!r}: expected an array with {self.n_taxels} taxels on its last axis, "
                f"found shape {counts.shape}; was it recorded with another hand?"
            )
        return {address: counts[..., part] for address, part in self._slices.items()}


def list_packaged_hands() -> list[str]:
    """Names of the descriptions that come with the library, sorted."""
    return sorted(
        entry.name.removesuffix(_SUFFIX) for entry in _descriptions().iterdir() if entry.name.endswith(_SUFFIX)
    )


def load_hand(name_or_path: str | os.PathLike[str]) -> Hand:
    """Load a hand description.

    Args:
        name_or_path: a packaged name ("allegro", "flat8"), or else a path to a TOML file.

    Raises:
        HandDescriptionError: no such name or file, not readable, or a mistake in it.
    """
    if name_or_path in list_packaged_hands():
        file = f"{name_or_path}{_SUFFIX}"
        return _build(parse_hand(_descriptions().joinpath(file).read_bytes(), file))
    file = format_path(os.fspath(name_or_path))
    return _build(parse_hand(read_description(name_or_path, "hand", list_packaged_hands()), file))


def parse_hand_description(data: bytes, file: str) -> Hand:
    """The hand that the bytes of a description file describe. `file`: its name, for errors.

    Raises HandDescriptionError for a mistake in it.
    """
    return _build(parse_hand(data, format_path(file)))


def read_hand_text(hand: Hand | str | os.PathLike[str]) -> str | None:
    """The text of a hand's description file: of a packaged name, a path, or a `Hand` that equals the packaged one.

    None for any other `Hand`: it does not know its file. Raises HandDescriptionError as `load_hand` does.
    """
    if isinstance(hand, Hand):
        if hand.name not in list_packaged_hands() or load_hand(hand.name) != hand:
            return None
        hand = hand.name
    if hand in list_packaged_hands():
        return _descriptions().joinpath(f"{hand}{_SUFFIX}").read_text()
    return read_description(hand, "hand", list_packaged_hands()).decode(errors="replace")


def _build(document: HandDocument) -> Hand:
    """The Hand that a checked document describes."""
    geometry = document.get("geometry", {})
    kinds = {}
    for name, table in document["kinds"].items():
        kind = BoardKind(name, table["code"], parse_crossings(table["crossings"]))
        if name in geometry:
            surface = build_surface(np.array(geometry[name]["taxels"], dtype=np.float64), kind.tx, kind.rx)
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
    if "link" not in table:
        return Board(table["name"], kind, table["address"])
    place = make_pose(np.array(table["position_m"], float), np.array(table["quaternion_wxyz"], float))
    return Board(table["name"], kind, table["address"], table["link"], _read_only(place))


def _descriptions() -> Traversable:
    return resources.files("taxel.hand").joinpath("descriptions")


def _or_empty(pose_or_none: NDArray[np.float64] | None) -> NDArray[np.float64]:
    return np.empty(0) if pose_or_none is None else pose_or_none


def _read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    array.setflags(write=False)
    return array
