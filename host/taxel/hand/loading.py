"""Loading of hand descriptions: packaged ones by name, other ones from a TOML file or its bytes."""

import os
from dataclasses import replace
from functools import lru_cache
from importlib import resources
from importlib.resources.abc import Traversable

import numpy as np

from taxel.hand.boards import Board, BoardKind, make_read_only
from taxel.hand.crossings import parse_crossings, parse_layout
from taxel.hand.description import Hand
from taxel.hand.errors import format_path
from taxel.hand.geometry import build_surface
from taxel.hand.schema import BoardTable, HandDocument, parse_hand
from taxel.hand.toml_text import read_description
from taxel.hand.transforms import make_pose
from taxel.hand.wiring import build_wiring

CACHED_HANDS = 4
"""Hands that are kept after their description has been read: the largest packaged description takes 50 ms."""

_SUFFIX = ".toml"


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
        return _parse_hand(_get_description_folder().joinpath(file).read_bytes(), file)
    file = format_path(os.fspath(name_or_path))
    return _parse_hand(read_description(name_or_path, "hand", list_packaged_hands()), file)


def parse_hand_description(data: bytes, file: str) -> Hand:
    """Build a hand from the bytes of its description file. file: file name in error messages.

    Raises HandDescriptionError for an error in the description.
    """
    return _parse_hand(data, format_path(file))


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


@lru_cache(maxsize=CACHED_HANDS)
def _parse_hand(data: bytes, file: str) -> Hand:
    """Build a hand from the bytes of its description file; equal bytes give the same object, which is immutable.

    file: file name in error messages. Raises HandDescriptionError.
    """
    return _build_hand(parse_hand(data, file))


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
        build_wiring(document),
    )


def _build_board(table: BoardTable, kind: BoardKind) -> Board:
    """Build a board of the given kind from its checked table in the hand description."""
    if "link" not in table:
        return Board(table["name"], kind, table["address"], branch=table.get("branch"))
    bracket_pose = make_pose(np.array(table["position_m"], float), np.array(table["quaternion_wxyz"], float))
    pose = make_read_only(bracket_pose)
    return Board(table["name"], kind, table["address"], table["link"], pose, table.get("branch"))


def _get_description_folder() -> Traversable:
    """Return the folder of the packaged hand descriptions."""
    return resources.files("taxel.hand").joinpath("descriptions")
