"""A recipe's file (TOML), checked key by key."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final, NoReturn, TypeVar

import numpy as np

from taxel.gap.report.reading import read_report
from taxel.generate.effects import PlannedEffect, planned_by_name, planned_of_report
from taxel.generate.errors import RecipeError
from taxel.generate.ranges import Range, fixed
from taxel.generate.recipe import FIDELITIES, HAND, Fidelity, GraspRanges, Recipe, SensorRanges, SimulatorRanges
from taxel.generate.solids import SIZES, ObjectKind, has_thesis_approaches, mesh_kind
from taxel.hand import load_hand
from taxel.hand.errors import format_path, format_value
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_checks import Place
from taxel.recording.grasp_tables import check_name
from taxel.sim.sensing import LEVELS
from taxel.sim.sensor_model import SensorModelError, SimSensor

Group = TypeVar("Group", GraspRanges, SimulatorRanges, SensorRanges)

LARGEST_BYTES: Final = 1 << 20
MOST_GRASPS: Final = 10**9
MOST_PER_SHARD: Final = 10_000
MOST_OBJECTS: Final = 1000
UNITS: Final[Mapping[str, float]] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}

CORRECT: Final = "correct it"


@dataclass(frozen=True)
class Key:
    """A value of the file, and where it stands."""

    file: str
    path: str
    value: Any

    def fail(self, expected: str, remedy: str = CORRECT, found: str | None = None) -> NoReturn:
        """Raise RecipeError for this place."""
        raise RecipeError(
            self.file, self.path or "file", expected, format_value(self.value) if found is None else found, remedy
        )

    def keys(self, known: Sequence[str]) -> dict[str, Key]:
        """What stands in a table that may have only these keys."""
        if not isinstance(self.value, dict):
            self.fail("a table")
        for name in self.value:
            if name not in known:
                self._below(name).fail(
                    f"one of {', '.join(known)}", "remove or rename that key", "a key of another name"
                )
        return {name: self._below(name) for name in self.value}

    def _below(self, name: str) -> Key:
        return Key(self.file, f"{self.path}.{name}" if self.path else name, self.value[name])

    def items(self) -> list[Key]:
        """The elements of a list."""
        if not isinstance(self.value, list):
            self.fail("a list; write [[...]] above it")
        return [Key(self.file, f"{self.path}[{k}]", one) for k, one in enumerate(self.value)]

    def text(self, known: Sequence[str] = ()) -> str:
        """A text, of `known` ones if there are any."""
        if not isinstance(self.value, str) or not self.value or (known and self.value not in known):
            self.fail(f"one of {', '.join(known)}" if known else "a text")
        return self.value

    def integer(self, low: int, high: int) -> int:
        """A whole number."""
        if isinstance(self.value, bool) or not isinstance(self.value, int) or not low <= self.value <= high:
            self.fail(f"a whole number from {low} to {high}")
        return self.value

    def number(self, low: float, high: float = np.inf) -> float:
        """A finite number."""
        if not _is_number(self.value) or not low <= self.value <= high:
            self.fail(f"a number from {low:g} to {high:g}")
        return float(self.value)

    def range(self, low: float = -np.inf, high: float = np.inf) -> Range:
        """A number, or [lowest, highest]."""
        both = self.value if isinstance(self.value, list) else [self.value, self.value]
        if len(both) != 2 or not all(map(_is_number, both)) or not low <= both[0] <= both[1] <= high:
            bounds = "" if np.isinf(low) and np.isinf(high) else f" from {low:g} to {high:g}"
            self.fail(f"a number or [lowest, highest]{bounds}")
        return Range(float(both[0]), float(both[1]))


def _is_number(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, int | float) and bool(np.isfinite(value))


def read_recipe(path: Path) -> Recipe:
    """The recipe of a file; paths in it are relative to its folder.

    Raises RecipeError of one line; CloudFileError and GapInputError for the files that it names; OSError.
    """
    data = path.read_bytes()
    name = format_path(path)
    if len(data) > LARGEST_BYTES:
        raise RecipeError(name, "file", "at most 1 MiB", "more", "is it a recipe?")
    try:
        content = tomllib.loads(data.decode("utf-8"))
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        raise RecipeError(name, "file", "TOML", " ".join(str(error).split())[:80], "correct the line") from None
    plain = ("grasps", "seed", "shard", "fidelity", "sensing")
    groups = {"grasp": GraspRanges, "simulator": SimulatorRanges, "sensor": SensorRanges}
    keys = Key(name, "", content).keys((*plain, "object", *groups, "report", "effect"))
    values: dict[str, Any] = {}
    for key, low, high in (("grasps", 1, MOST_GRASPS), ("seed", 0, 2**63 - 1), ("shard", 1, MOST_PER_SHARD)):
        if key in keys:
            values[key] = keys[key].integer(low, high)
    for key, known in (("fidelity", tuple(FIDELITIES)), ("sensing", LEVELS)):
        if key in keys:
            values[key] = keys[key].text(known)
    for key, group in groups.items():
        if key in keys:
            values[key] = _group(group(), keys[key])
    if "object" in keys:
        values["objects"] = _objects(keys["object"], path.parent)
    recipe = Recipe(**values)
    if "report" in keys:
        recipe = _with_report(recipe, keys["report"], path.parent)
    if "effect" in keys:
        timing = FIDELITIES[recipe.fidelity]
        recipe = replace(recipe, effects=recipe.effects + tuple(_effect(one, timing) for one in keys["effect"].items()))
    return checked(recipe, name)


def checked(recipe: Recipe, file: str) -> Recipe:
    """The same recipe, if its parts go together. file: for errors."""
    if recipe.simulator.friction != fixed(0.0) and recipe.sensing != "rigid":
        expected, remedy = '0 unless sensing is "rigid"', 'set sensing = "rigid", or leave friction out'
        raise RecipeError(file, "simulator.friction", expected, "another", remedy)
    names = [kind.name for kind in recipe.objects]
    double = next((name for name in names if names.count(name) > 1), None)
    if double is not None:
        raise RecipeError(file, "object", "each name once", format_value(double), "rename one")
    effects = [one.name for one in recipe.effects]
    twice = next((name for name in effects if effects.count(name) > 1), None)
    if twice is not None:
        raise RecipeError(file, "effect", "each effect once", f"{twice} again", "take it from the report or by name")
    return recipe


def with_report(recipe: Recipe, path: Path, widen: float = 1.0, share: float = 1.0) -> Recipe:
    """The recipe with the effects of a gap report besides. Raises GapInputError, RecipeError, OSError."""
    found = planned_of_report(read_report(path), load_hand(HAND), widen, share)
    return replace(recipe, effects=recipe.effects + found)


def with_mesh(recipe: Recipe, path: Path, unit: str) -> Recipe:
    """The recipe with a mesh file as another kind of object, up to 10 % smaller or larger. Raises as `mesh_kind`."""
    kind = mesh_kind(path, object_name(path.stem, str(path)), Range(0.9, 1.1), UNITS[unit])
    return replace(recipe, objects=(*recipe.objects, kind))


def object_name(text: str, file: str) -> str:
    """A name that an object may have in a dataset. Raises RecipeError."""
    try:
        return check_name(text, Place(file))
    except DatasetError as error:
        raise RecipeError(file, "name", error.expected, error.found, error.remedy) from None


def _group(group: Group, table: Key) -> Group:
    """A group of ranges with what the table says of it."""
    own = {one.name: getattr(group, one.name) for one in fields(group)}
    values: dict[str, Any] = {}
    for name, key in table.keys(tuple(own)).items():
        if isinstance(own[name], Range):
            values[name] = key.range(*_bounds(name))
        else:
            values[name] = key.number(0.0, 1.0 if name.endswith("share") else 90.0)
    made = replace(group, **values)
    if isinstance(made, SensorRanges):
        for name, key in table.keys(tuple(own)).items():
            for value in (getattr(made, name).low, getattr(made, name).high):
                try:
                    SimSensor(**{name: value})
                except SensorModelError as error:
                    key.fail(error.expected, found=error.found)
    return made


def _bounds(name: str) -> tuple[float, float]:
    """What can be simulated at all."""
    known = {"turn_deg": (-360.0, 360.0), "grip": (0.0, 3.0), "friction": (0.0, 5.0), "layer_stiffness": (0.05, 20.0)}
    known |= {"thumb_deg": (-30.0, 30.0), "press_mm": (-20.0, 5.0)}
    return known.get(name, (-50.0, 50.0) if name.endswith("_mm") else (-np.inf, np.inf))


def _objects(table: Key, folder: Path) -> tuple[ObjectKind, ...]:
    items = table.items()
    if not 1 <= len(items) <= MOST_OBJECTS:
        table.fail(f"1 to {MOST_OBJECTS} kinds of objects", found=str(len(items)))
    return tuple(_object(one, folder) for one in items)


def _object(table: Key, folder: Path) -> ObjectKind:
    every = sorted({size for sizes in SIZES.values() for size in sizes})
    keys = table.keys(("name", "shape", "share", "approaches", "file", "unit", *every))
    for needed in ("name", "shape"):
        if needed not in keys:
            table.fail(f"a key {needed}", "add it", "none")
    name = object_name(keys["name"].text(), table.file)
    shape = keys["shape"].text(tuple(SIZES))
    share = keys["share"].number(0.0, 1e6) if "share" in keys else 1.0
    if share == 0.0:
        keys["share"].fail("a share above 0", "leave the object out instead")
    allowed = {"name", "shape", "share", *SIZES[shape], *(("file", "unit") if shape == "mesh" else ("approaches",))}
    for key in sorted(set(keys) - allowed):
        keys[key].fail(
            f"a key of a {shape} ({', '.join(sorted(allowed))})", "remove that key", "a key of another shape"
        )
    if shape == "mesh":
        if "file" not in keys:
            table.fail("a key file", "name its STL, OBJ or PLY file", "none")
        unit = UNITS[keys["unit"].text(tuple(UNITS)) if "unit" in keys else "m"]
        scale = keys["scale"].range(0.01, 100.0) if "scale" in keys else fixed(1.0)
        return mesh_kind(folder / keys["file"].text(), name, scale, unit, share)
    missing = [size for size in SIZES[shape] if size not in keys]
    if missing:
        table.fail(f"a key {missing[0]}", "add it", "none")
    sizes = {size: keys[size].range(5.0, 500.0) for size in SIZES[shape]}
    approaches = "thesis" if has_thesis_approaches(name) else "any"
    if "approaches" in keys:
        asked = keys["approaches"].text(("thesis", "any"))
        if asked == "thesis" and approaches == "any":
            keys["approaches"].fail(
                '"any", for an object that the thesis does not have', "rename the object, or take any"
            )
        approaches = asked
    return ObjectKind(name, shape, sizes, share, approaches)  # type: ignore[arg-type]


def _with_report(recipe: Recipe, table: Key, folder: Path) -> Recipe:
    keys = table.keys(("file", "widen", "share"))
    if "file" not in keys:
        table.fail("a key file", "name a report.json of taxel gap diagnose", "none")
    widen = keys["widen"].number(0.0, 100.0) if "widen" in keys else 1.0
    share = keys["share"].number(0.0, 1.0) if "share" in keys else 1.0
    return with_report(recipe, folder / keys["file"].text(), widen, share)


def _effect(table: Key, timing: Fidelity) -> PlannedEffect:
    if not isinstance(table.value, dict):
        table.fail("a table")
    plain = ("name", "form", "scope", "share")
    keys = table.keys(tuple(table.value))
    if "name" not in keys:
        table.fail("a key name", "name an effect of the catalogue", "none")
    form, scope = (keys[key].text() if key in keys else "" for key in ("form", "scope"))
    share = keys["share"].number(0.0, 1.0) if "share" in keys else 1.0
    ranges = {key: one.range() for key, one in keys.items() if key not in plain}
    moving_s = timing.timeline.duration_s - timing.timeline.baseline_s
    where = f"{table.file}: {table.path}"
    return planned_by_name(where, keys["name"].text(), form, scope, share, ranges, load_hand(HAND), moving_s)
