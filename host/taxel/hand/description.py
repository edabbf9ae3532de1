"""What a hand is made of: its boards, their kinds, and which TX x RX crossings are taxels.

The description file gives this; no shape is written in code. The order of taxels set here is the order of
the last axis of every array in the library: boards by address, and on a board row-major over the crossing
map (TX 0 first, and on a TX line RX 0 first).
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from taxel.hand.crossings import crossing_array
from taxel.hand.errors import Field, UnknownBoardError, shown_address, shown_path
from taxel.hand.schema import HandDocument, parse_hand
from taxel.hand.toml_text import MAX_FILE_BYTES
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

    Raises:
        ValueError: not 1..16 lines each way, or not 1..240 taxels.
    """

    name: str
    code: int
    crossings: NDArray[np.bool_]

    def __post_init__(self) -> None:
        crossings = np.array(self.crossings, dtype=np.bool_)
        if crossings.ndim != 2 or not all(1 <= lines <= LINES_MAX for lines in crossings.shape):
            raise ValueError(f"kind {self.name!r}: expected 1..{LINES_MAX} TX and RX lines, found {crossings.shape}")
        if not 1 <= crossings.sum() <= TAXELS_MAX:
            raise ValueError(f"kind {self.name!r}: expected 1..{TAXELS_MAX} taxels, found {crossings.sum()}")
        object.__setattr__(self, "crossings", _read_only(crossings))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, BoardKind):
            return NotImplemented
        return (self.name, self.code) == (other.name, other.code) and np.array_equal(self.crossings, other.crossings)

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


@dataclass(frozen=True)
class Board:
    """One sensor board of a hand.

    Attributes:
        name: such as "fingertip_index".
        kind: its design.
        address: 7-bit I2C address.
    """

    name: str
    kind: BoardKind
    address: int


@dataclass(frozen=True)
class Hand:
    """A tactile skin: its boards and the order of all its taxels.

    Attributes:
        name: such as "allegro".
        description: one line for people.
        pitch_m: distance between neighbouring taxel centres, metres.
        size_m: side of a square taxel, metres.
        boards: in the order of their addresses, whatever order they were given in.

    Raises:
        ValueError: no boards, or two with one address or one name.
    """

    name: str
    description: str
    pitch_m: float
    size_m: float
    boards: tuple[Board, ...]
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

    def board(self, address: int) -> Board:
        """The board at a 7-bit I2C address; UnknownBoardError if there is none."""
        for board in self.boards:
            if board.address == address:
                return board
        raise UnknownBoardError(self.name, shown_address(address), [shown_address(b.address) for b in self.boards])

    def board_named(self, name: str) -> Board:
        """The board of that name; UnknownBoardError if there is none."""
        for board in self.boards:
            if board.name == name:
                return board
        raise UnknownBoardError(self.name, repr(name), [board.name for board in self.boards])

    def slice_of(self, address: int) -> slice:
        """Where a board's taxels lie on the taxel axis; UnknownBoardError if the hand has no such board."""
        return self._slices[self.board(address).address]

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


def packaged_hands() -> list[str]:
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
    if name_or_path in packaged_hands():
        file = f"{name_or_path}{_SUFFIX}"
        return _build(parse_hand(_descriptions().joinpath(file).read_bytes(), file))
    file = shown_path(os.fspath(name_or_path))
    return _build(parse_hand(_read(Path(name_or_path), file), file))


def _read(path: Path, file: str) -> bytes:
    names = ", ".join(packaged_hands())
    whole = Field(file)
    try:
        if not path.exists():
            whole.fail("a description file or a packaged hand", "no such file", f"the packaged hands are {names}")
        if not path.is_file():  # a pipe or a device might never end
            whole.fail("a regular file", "something else", f"name a TOML file or a packaged hand ({names})")
        with path.open("rb") as stream:
            return stream.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        whole.fail("a readable file", error.strerror or type(error).__name__, "check its permissions and its name")


def _build(document: HandDocument) -> Hand:
    """The Hand that a checked document describes."""
    kinds = {
        name: BoardKind(name, table["code"], crossing_array(table["crossings"]))
        for name, table in document["kinds"].items()
    }
    boards = tuple(Board(board["name"], kinds[board["kind"]], board["address"]) for board in document["boards"])
    taxel = document["taxel"]
    return Hand(document["name"], document["description"], float(taxel["pitch_m"]), float(taxel["size_m"]), boards)


def _descriptions() -> Traversable:
    return resources.files("taxel.hand").joinpath("descriptions")


def _read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    array.setflags(write=False)
    return array
