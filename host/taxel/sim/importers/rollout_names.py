"""Which parts of a user's MuJoCo model are the boards and the object.

A map is TOML (or the same as a dictionary)::

    prefix = "rh_"                       # of the links' bodies; found by itself where all links have one
    [object]
    body = "can"                         # the object's body
    known = "cylinder"                   # a known shape in that body's frame; else the shape of its one geom
    [boards]
    palm = "palm_pad"                    # a geom, a body or a site
    fingertip_index = { body = "ff_tip" }
    fingertip_thumb = { site = "thumb_bracket" }   # a site is the bracket's frame itself
"""

import os
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import mujoco
import numpy as np
from numpy.typing import NDArray

from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError, format_value
from taxel.hand.transforms import make_pose
from taxel.sim.importers.errors import Source, near_names
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
    """Parts of a model, s boards.

    board_body: i64[s], the body that carries each board. board_pose: f64[s, 4, 4], its bracket in that body.
    board_of_geom: i64[geoms], the board of a geom's contacts; -1: none, or that of `board_body` which is nearest.
    object_body: of the object. known: name of a known shape in its frame, or "".
    """

    board_body: NDArray[np.int64]
    board_pose: FloatArray
    board_of_geom: NDArray[np.int64]
    by_body: NDArray[np.bool_]
    object_body: int
    known: str


def load_map(path: str | os.PathLike[str]) -> tuple[dict[str, Any], Source]:
    """Read a map; raises ImportDataError for what is not TOML."""
    source, file = Source(os.fspath(path)), Path(path)
    if not file.is_file():
        source.fail("a TOML file", "a folder" if file.is_dir() else "no such file", "check the path")
    try:
        return tomllib.loads(file.read_text(encoding="utf-8")), source
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        source.fail("valid TOML", format_value(str(error).partition("\n")[0]), "correct the syntax there")
    except OSError as error:
        source.fail("a readable file", error.strerror or type(error).__name__, "check its permissions")


def model_names(model: mujoco.MjModel, kind: str) -> list[str]:
    """Names of the geoms, bodies or sites of a model, "" where one has none."""
    return [mujoco.mj_id2name(model, _TYPES[kind], index) or "" for index in range(getattr(model, _SIZES[kind]))]


def find_parts(model: mujoco.MjModel, hand: Hand, given: Mapping[str, Any], source: Source) -> ModelParts:
    """Find the boards and the object. given: a map, see above; source: where it is from, for errors.

    A board without an entry is the geom of its name, or sits on the body of its link; a common prefix of all of these
    is found, such as "link:" or "rh_". Raises ImportDataError for a name that the model lacks,
    HandGeometryError for a hand without links.
    """
    for key in given:
        if key not in _KEYS:
            source.key(key).fail("known keys", "an unknown one", f"correct or remove it ({near_names(key, _KEYS)})")
    if any(board.link_name is None or board.pose is None for board in hand.boards):
        raise HandGeometryError(hand.name)
    names = {kind: model_names(model, kind) for kind in KINDS}
    finder = _Finder(model, hand, names, source)
    boards = _table(given.get("boards", {}), source.key("boards"))
    for name in boards:
        if name not in {board.name for board in hand.boards}:
            near = near_names(name, [board.name for board in hand.boards])
            source.key("boards").key(name).fail(f"a board of {hand.name}", "another name", near)
    entries = {name: finder.entry(value, source.key("boards").key(name)) for name, value in boards.items()}
    entries.update(
        finder.others([board.name for board in hand.boards if board.name not in entries], given.get("prefix"))
    )
    object_body, known = finder.item(_table(given.get("object", {}), source.key("object")))
    return finder.parts(entries, object_body, known)


def _table(value: Any, place: Source) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        place.fail("a table", format_value(value), "write it as in the documentation")
    return dict(value)


class _Finder:
    """Names of a model, and what they stand for."""

    def __init__(self, model: mujoco.MjModel, hand: Hand, names: Mapping[str, Sequence[str]], source: Source) -> None:
        self.model, self.hand, self.names, self.source = model, hand, names, source

    def entry(self, value: Any, place: Source) -> tuple[str, int]:
        """Kind and index of what an entry names: a name, or a table of kind and name."""
        if isinstance(value, str):
            kinds = [kind for kind in KINDS if value in self.names[kind] and value]
            if len(kinds) > 1:
                place.fail(
                    f"one of {', '.join(KINDS)}",
                    f"{format_value(value)} as {' and '.join(kinds)}",
                    "write { body = ... }",
                )
            if not kinds:
                self._missing(value, KINDS, place)
            return kinds[0], self.names[kinds[0]].index(value)
        if not isinstance(value, Mapping) or len(value) != 1 or next(iter(value)) not in KINDS:
            place.fail("a name, or { geom, body or site = name }", format_value(value), "write it so")
        kind, name = next(iter(value.items()))
        if not isinstance(name, str) or not name or name not in self.names[kind]:
            self._missing(str(name), (kind,), place)
        return kind, self.names[kind].index(name)

    def _missing(self, name: str, kinds: Sequence[str], place: Source) -> None:
        known = dict.fromkeys(name for kind in kinds for name in self.names[kind] if name)
        place.fail(
            f"a {' or '.join(kinds)} of the model", f"{format_value(name)}, which it lacks", near_names(name, known)
        )

    def others(self, boards: Sequence[str], prefix: Any) -> dict[str, tuple[str, int]]:
        """What the boards without an entry are."""
        if not boards:
            return {}
        if prefix is not None and not isinstance(prefix, str):
            self.source.key("prefix").fail("a text", format_value(prefix), "write the part before the links' names")
        links = {board.name: str(board.link_name) for board in self.hand.boards if board.name in boards}
        found = self._with_prefix("geom", {name: name for name in boards}, prefix)
        if found is None:
            found = self._with_prefix("body", links, prefix)
        if found is None:
            self._lacking(links, prefix)
        return found

    def _with_prefix(
        self, kind: str, wanted: Mapping[str, str], prefix: str | None
    ) -> dict[str, tuple[str, int]] | None:
        """What the boards are if one prefix makes all the wanted names into names of the model."""
        names = self.names[kind]
        for start in self._prefixes(kind, next(iter(wanted.values())), prefix):
            if all(start + name in names for name in wanted.values()):
                return {board: (kind, names.index(start + name)) for board, name in wanted.items()}
        return None

    def _lacking(self, links: Mapping[str, str], prefix: str | None) -> NoReturn:
        """Refuse a model without a body for the link of every board."""
        boards = list(links)
        starts = [*self._prefixes("body", links[boards[0]], prefix), prefix or ""]
        best = max(starts, key=lambda start: sum(start + links[name] in self.names["body"] for name in boards))
        lost = next(name for name in boards if best + links[name] not in self.names["body"])
        place = self.source.key("boards").key(lost)
        near = near_names(best + links[lost], [name for name in self.names["body"] if name])
        found = f"no body {format_value(best + links[lost])}"
        place.fail("a body, geom or site for every board", found, f"name it under [boards] ({near})")

    def _prefixes(self, kind: str, ending: str, prefix: Any) -> Iterator[str]:
        if prefix is not None:
            yield prefix
            return
        yield from sorted({name.removesuffix(ending) for name in self.names[kind] if name.endswith(ending)}, key=len)

    def item(self, given: dict[str, Any]) -> tuple[int, str]:
        """The object's body and the name of its known shape, or ""."""
        place = self.source.key("object")
        for key in given:
            if key not in ("body", "known"):
                place.key(key).fail("body or known", "an unknown key", near_names(key, ("body", "known")))
        known = given.get("known", "")
        if not isinstance(known, str):
            place.key("known").fail("a name", format_value(known), "name a known object, or leave it out")
        wanted = given.get("body", "object")
        if wanted not in self.names["body"] or not wanted:
            self._missing(str(wanted), ("body",), place.key("body"))
        return self.names["body"].index(wanted), known

    def parts(self, entries: Mapping[str, tuple[str, int]], object_body: int, known: str) -> ModelParts:
        """Bodies, bracket poses and geoms of all boards."""
        model, boards = self.model, self.hand.boards
        body, place = np.zeros(len(boards), np.int64), np.zeros((len(boards), 4, 4))
        of_geom, by_body = np.full(model.ngeom, -1, np.int64), np.zeros(len(boards), bool)
        for index, board in enumerate(boards):
            kind, where = entries[board.name]
            if kind == "site":
                body[index], place[index] = (
                    model.site_bodyid[where],
                    make_pose(model.site_pos[where], model.site_quat[where]),
                )
            else:
                if board.pose is None:
                    raise HandGeometryError(self.hand.name)
                body[index], place[index] = model.geom_bodyid[where] if kind == "geom" else where, board.pose
            by_body[index] = kind != "geom"
            if kind == "geom":
                if of_geom[where] >= 0:
                    other = boards[int(of_geom[where])].name
                    at = self.source.key("boards").key(board.name)
                    at.fail(
                        "a geom for each board", f"that of {other}", "name the body, and contacts go to the nearest"
                    )
                of_geom[where] = index
        return ModelParts(body, place, of_geom, by_body, object_body, known)
