"""Assignment of the parts of a MuJoCo model to the boards of the hand and to the object.

The model map is a TOML file (or an equal dictionary)::

    prefix = "rh_"                       # common prefix of the bodies of the links; default: found automatically
    [object]
    body = "can"                         # body of the object; default: "object"
    known = "cylinder"                   # a known shape in the frame of the body; default: the shape of its only geom
    [boards]
    palm = "palm_pad"                    # a geom, a body or a site
    fingertip_index = { body = "ff_tip" }
    fingertip_thumb = { site = "thumb_bracket" }   # the frame of a site is the frame of the bracket
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import mujoco
import numpy as np
from numpy.typing import NDArray

from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError, format_path, format_value
from taxel.hand.transforms import make_pose
from taxel.input_files import TextError, parse_toml, read_regular_file
from taxel.input_files.toml_text import TOML_BYTES_MAX
from taxel.sim.importers.errors import FileLocation, ImportDataError, suggest_names
from taxel.types import FloatArray

__all__ = ["ModelParts", "find_parts", "load_map", "model_names"]

KINDS = ("geom", "body", "site")
_TYPES = {
    "geom": mujoco.mjtObj.mjOBJ_GEOM,
    "body": mujoco.mjtObj.mjOBJ_BODY,
    "site": mujoco.mjtObj.mjOBJ_SITE,
}
_SIZES = {"geom": "ngeom", "body": "nbody", "site": "nsite"}
_KEYS = ("prefix", "object", "boards")


@dataclass(frozen=True, eq=False)
class ModelParts:
    """Parts of a model for s boards and the object.

    board_body: i64[s], index of the body of each board. board_pose: f64[s, 4, 4], bracket in the frame of the body.
    board_of_geom: i64[geoms], board of the contacts of a geom; -1: not assigned to a board. is_by_body: bool[s],
    whether a board has no geom of its own, so that it gets the contacts of its body near its taxels. object_body: index
    of the body of the object. known_shape: name of a known shape in the frame of this body, or "".
    """

    board_body: NDArray[np.int64]
    board_pose: FloatArray
    board_of_geom: NDArray[np.int64]
    is_by_body: NDArray[np.bool_]
    object_body: int
    known_shape: str


def load_map(path: str | os.PathLike[str]) -> tuple[dict[str, Any], FileLocation]:
    """Read a model map (a TOML file with names of a MuJoCo model), and return it with its location for errors.

    Raises ImportDataError for a missing or unreadable file and for a file that is not TOML.
    """
    source, file = FileLocation(os.fspath(path)), Path(path)
    if not file.is_file():
        source.fail("a TOML file", "a folder" if file.is_dir() else "no such file", "check the path")
    try:
        return parse_toml(read_regular_file(file, TOML_BYTES_MAX)), source
    except TextError as error:
        raise ImportDataError(
            format_path(source.file), error.position, error.expected, format_value(error.found), "correct the syntax"
        ) from None
    except OSError as error:
        source.fail("a readable file", error.strerror or type(error).__name__, "check its permissions")


def model_names(model: mujoco.MjModel, kind: str) -> list[str]:
    """List the names of a model's geoms, bodies or sites by index; "" for a part without a name.

    kind: one of `KINDS`.
    """
    return [mujoco.mj_id2name(model, _TYPES[kind], index) or "" for index in range(getattr(model, _SIZES[kind]))]


def find_parts(model: mujoco.MjModel, hand: Hand, model_map: Mapping[str, Any], source: FileLocation) -> ModelParts:
    """Find the parts of a MuJoCo model that belong to the boards of a hand and to the object.

    model_map: names of the parts, with the optional keys "prefix", "object" and "boards". source: location of the map,
    for errors. A board without an entry in the map is assigned to the geom that has the board's name. If the model
    lacks these geoms, such boards are assigned to the bodies that have the names of the boards' links. A common prefix
    of all these names, such as "link:" or "rh_", is found automatically. Raises ImportDataError for a name that the
    model lacks, HandGeometryError for a hand without links.
    """
    for key in model_map:
        if key not in _KEYS:
            source.key(key).fail("a known key", "an unknown key", f"correct or remove it ({suggest_names(key, _KEYS)})")
    if any(board.link_name is None or board.pose is None for board in hand.boards):
        raise HandGeometryError(hand.name)
    names = {kind: model_names(model, kind) for kind in KINDS}
    finder = _PartFinder(model, hand, names, source)
    boards = _require_table(model_map.get("boards", {}), source.key("boards"))
    for name in boards:
        if name not in {board.name for board in hand.boards}:
            suggestion = suggest_names(name, [board.name for board in hand.boards])
            source.key("boards").key(name).fail(f"a board of {hand.name}", "another name", suggestion)
    entries = {name: finder.find_entry(value, source.key("boards").key(name)) for name, value in boards.items()}
    unlisted = [board.name for board in hand.boards if board.name not in entries]
    entries.update(finder.find_unlisted(unlisted, model_map.get("prefix")))
    object_body, known_shape = finder.find_object(_require_table(model_map.get("object", {}), source.key("object")))
    return finder.make_parts(entries, object_body, known_shape)


def _require_table(value: Any, location: FileLocation) -> dict[str, Any]:
    """Return a value of the model map as a dictionary. Raises ImportDataError for another type."""
    if not isinstance(value, Mapping):
        location.fail("a table", format_value(value), "write it as in docs/how-to-import.md")
    return dict(value)


class _PartFinder:
    """Search for parts of a MuJoCo model by name; a part is ("geom", "body" or "site", index in the model)."""

    def __init__(
        self, model: mujoco.MjModel, hand: Hand, names: Mapping[str, Sequence[str]], source: FileLocation
    ) -> None:
        """Create a search for the parts of a hand in a MuJoCo model.

        names: all names in the model by kind of part ("geom", "body", "site"). source: location of the model map, which
        error messages state.
        """
        self.model, self.hand, self.names, self.source = model, hand, names, source

    def find_entry(self, value: Any, location: FileLocation) -> tuple[str, int]:
        """Find the part of the model that a value of the model map names: (kind, index in the model).

        value: a name, or a table of kind ("geom", "body" or "site") and name. Raises ImportDataError for an unknown
        name.
        """
        if isinstance(value, str):
            kinds = [kind for kind in KINDS if value in self.names[kind] and value]
            if len(kinds) > 1:
                found = f"{format_value(value)} as {' and '.join(kinds)}"
                location.fail(f"one of {', '.join(KINDS)}", found, f"write {{ {kinds[0]} = {format_value(value)} }}")
            if not kinds:
                self._fail_for_unknown_name(value, KINDS, location)
            return kinds[0], self.names[kinds[0]].index(value)
        if not isinstance(value, Mapping) or len(value) != 1 or next(iter(value)) not in KINDS:
            location.fail("a name, or { geom, body or site = name }", format_value(value), "use one of these formats")
        kind, name = next(iter(value.items()))
        if not isinstance(name, str) or not name or name not in self.names[kind]:
            self._fail_for_unknown_name(str(name), (kind,), location)
        return kind, self.names[kind].index(name)

    def _fail_for_unknown_name(self, name: str, kinds: Sequence[str], location: FileLocation) -> None:
        """Raise ImportDataError for a name that no geom, body or site (as listed in `kinds`) of the model has."""
        known_names = dict.fromkeys(name for kind in kinds for name in self.names[kind] if name)
        found = f"{format_value(name)}, which the model lacks"
        location.fail(f"a {' or '.join(kinds)} of the model", found, suggest_names(name, known_names))

    def find_unlisted(self, boards: Sequence[str], prefix: Any) -> dict[str, tuple[str, int]]:
        """Find the parts of the model for the boards that the model map does not list: (kind, index) by board name.

        prefix: common beginning of the names in the model; None: found automatically. Raises ImportDataError.
        """
        if not boards:
            return {}
        if prefix is not None and not isinstance(prefix, str):
            self.source.key("prefix").fail(
                "a string", format_value(prefix), "write the common beginning of the names of the links"
            )
        links = {board.name: str(board.link_name) for board in self.hand.boards if board.name in boards}
        entries = self._find_with_prefix("geom", {name: name for name in boards}, prefix)
        if entries is None:
            entries = self._find_with_prefix("body", links, prefix)
        if entries is None:
            self._fail_for_missing_body(links, prefix)
        return entries

    def _find_with_prefix(
        self, kind: str, name_of_board: Mapping[str, str], prefix: str | None
    ) -> dict[str, tuple[str, int]] | None:
        """Find a prefix with which all names are names of the model; return (kind, index) by board name, or None.

        name_of_board: name by board, without the prefix. prefix: the only prefix to try; None: all possible ones.
        """
        names = self.names[kind]
        for start in self._possible_prefixes(kind, next(iter(name_of_board.values())), prefix):
            if all(start + name in names for name in name_of_board.values()):
                return {board: (kind, names.index(start + name)) for board, name in name_of_board.items()}
        return None

    def _fail_for_missing_body(self, links: Mapping[str, str], prefix: str | None) -> NoReturn:
        """Raise ImportDataError that names the first board whose link is not the name of a body in the model.

        The names are compared with the prefix with which most links are names of bodies. links: name of the link by
        board. prefix: given by the user, or None.
        """
        boards, bodies = list(links), self.names["body"]
        prefixes = [*self._possible_prefixes("body", links[boards[0]], prefix), prefix or ""]
        best = max(prefixes, key=lambda start: sum(start + links[name] in bodies for name in boards))
        board = next(name for name in boards if best + links[name] not in bodies)
        suggestion = suggest_names(best + links[board], [name for name in bodies if name])
        found = f"no body {format_value(best + links[board])}"
        remedy = f"name it under [boards] ({suggestion})"
        self.source.key("boards").key(board).fail("a body, geom or site for every board", found, remedy)

    def _possible_prefixes(self, kind: str, ending: str, prefix: Any) -> Iterator[str]:
        """Yield the given prefix, or else all beginnings of names of the model that end with `ending`, shortest first.

        kind: "geom", "body" or "site".
        """
        if prefix is not None:
            yield prefix
            return
        yield from sorted({name.removesuffix(ending) for name in self.names[kind] if name.endswith(ending)}, key=len)

    def find_object(self, table: dict[str, Any]) -> tuple[int, str]:
        """Return the index of the object's body in the model, and the name of its known shape or "".

        table: table [object] of the model map. Raises ImportDataError.
        """
        location = self.source.key("object")
        for key in table:
            if key not in ("body", "known"):
                location.key(key).fail("body or known", "an unknown key", suggest_names(key, ("body", "known")))
        known_shape = table.get("known", "")
        if not isinstance(known_shape, str):
            location.key("known").fail("a name", format_value(known_shape), "name a known object, or remove the key")
        body = table.get("body", "object")
        if body not in self.names["body"] or not body:
            self._fail_for_unknown_name(str(body), ("body",), location.key("body"))
        return self.names["body"].index(body), known_shape

    def make_parts(self, entries: Mapping[str, tuple[str, int]], object_body: int, known_shape: str) -> ModelParts:
        """Combine the parts of all boards and of the object. Raises ImportDataError for two boards with the same geom.

        The frame of a site is the frame of the board's bracket. A board at a geom or a body has the bracket pose of the
        hand description.

        entries: (kind, index in the model) by board name. object_body: index of the object's body. known_shape: name of
        its shape or "".
        """
        model, boards = self.model, self.hand.boards
        body, pose = np.zeros(len(boards), np.int64), np.zeros((len(boards), 4, 4))
        board_of_geom, is_by_body = np.full(model.ngeom, -1, np.int64), np.zeros(len(boards), bool)
        for number, board in enumerate(boards):
            kind, index = entries[board.name]
            if kind == "site":
                body[number] = model.site_bodyid[index]
                pose[number] = make_pose(model.site_pos[index], model.site_quat[index])
            else:
                if board.pose is None:
                    raise HandGeometryError(self.hand.name)
                body[number], pose[number] = model.geom_bodyid[index] if kind == "geom" else index, board.pose
            is_by_body[number] = kind != "geom"
            if kind == "geom":
                if board_of_geom[index] >= 0:
                    found = f"the geom of {boards[int(board_of_geom[index])].name}"
                    remedy = "name the body instead; its contacts are assigned to the nearest board"
                    self.source.key("boards").key(board.name).fail("a geom for each board", found, remedy)
                board_of_geom[index] = number
        return ModelParts(body, pose, board_of_geom, is_by_body, object_body, known_shape)
