"""Reader of recipe files (TOML), which checks every key."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Final, NoReturn, TypeVar, cast

import numpy as np

from taxel.gap.report.reading import read_report
from taxel.generate.effects import PlannedEffect, plan_effect, plan_report_effects
from taxel.generate.errors import RecipeError
from taxel.generate.ranges import Range, fixed
from taxel.generate.recipe import (
    DEFAULT_HAND,
    FIDELITIES,
    Fidelity,
    GraspRanges,
    Recipe,
    SensorRanges,
    SimulatorRanges,
    get_sizes,
)
from taxel.generate.solids import (
    SIZES,
    Approaches,
    ObjectKind,
    Solid,
    get_edge_m,
    has_thesis_approaches,
    read_mesh_kind,
)
from taxel.grasp.objects import ObjectSizes
from taxel.hand import Hand, load_hand
from taxel.hand.errors import format_path, format_value
from taxel.input_files import TextError, parse_toml, read_regular_file
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_checks import Location
from taxel.recording.grasp_tables import check_name
from taxel.sim.sensing import LEVELS
from taxel.sim.sensor_model import SensorModelError, SimSensor

Ranges = TypeVar("Ranges", GraspRanges, SimulatorRanges, SensorRanges)

MAX_FILE_BYTES: Final = 1 << 20
MAX_GRASPS: Final = 10**9
MAX_GRASPS_PER_SHARD: Final = 10_000
MAX_OBJECTS: Final = 1000
UNITS: Final[Mapping[str, float]] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}

HANDS: Final = ("original", "original_complete", "allegro")
"""Packaged hands on a robot with an arm, which can grasp."""

CORRECT: Final = "correct it"


@dataclass(frozen=True)
class Key:
    """A value of a recipe file with its location (file and path of keys) for messages."""

    file: str
    path: str
    value: Any

    def fail(self, expected: str, remedy: str = CORRECT, found: str | None = None) -> NoReturn:
        """Raise RecipeError for this value of the recipe file. found: what is found; None: the value itself."""
        raise RecipeError(
            self.file, self.path or "file", expected, format_value(self.value) if found is None else found, remedy
        )

    def keys(self, allowed: Sequence[str]) -> dict[str, Key]:
        """Return the values of a table by key. Raises RecipeError for another type or a key not in `allowed`."""
        if not isinstance(self.value, dict):
            self.fail("a table")
        for name in self.value:
            if name not in allowed:
                self._below(name).fail(f"one of {', '.join(allowed)}", "remove or rename that key", "another key")
        return {name: self._below(name) for name in self.value}

    def _below(self, name: str) -> Key:
        """Return the value of key `name` of this table, with its path for messages."""
        return Key(self.file, f"{self.path}.{name}" if self.path else name, self.value[name])

    def items(self) -> list[Key]:
        """Return the elements of a list in the recipe file. Raises RecipeError for another type."""
        if not isinstance(self.value, list):
            self.fail("a list; write [[...]] above it")
        return [Key(self.file, f"{self.path}[{k}]", value) for k, value in enumerate(self.value)]

    def text(self, choices: Sequence[str] = ()) -> str:
        """Return the value, a non-empty string, and one of `choices` if there are any. Raises RecipeError otherwise."""
        if not isinstance(self.value, str) or not self.value or (choices and self.value not in choices):
            self.fail(f"one of {', '.join(choices)}" if choices else "a string")
        return self.value

    def integer(self, low: int, high: int) -> int:
        """Return the value, an integer from `low` to `high`. Raises RecipeError for another value."""
        if isinstance(self.value, bool) or not isinstance(self.value, int) or not low <= self.value <= high:
            self.fail(f"an integer from {low} to {high}")
        return self.value

    def number(self, low: float, high: float = np.inf) -> float:
        """Return the value, a finite number from `low` to `high`. Raises RecipeError for another value."""
        if not _is_number(self.value) or not low <= self.value <= high:
            self.fail(f"a number from {low:g} to {high:g}")
        return float(self.value)

    def range(self, low: float = -np.inf, high: float = np.inf) -> Range:
        """Return the value, a number or a list [lowest, highest], as a range.

        Raises RecipeError for another value, and for a range that is not within `low` to `high`.
        """
        ends = self.value if isinstance(self.value, list) else [self.value, self.value]
        if len(ends) != 2 or not all(map(_is_number, ends)) or not low <= ends[0] <= ends[1] <= high:
            bounds = "" if np.isinf(low) and np.isinf(high) else f" from {low:g} to {high:g}"
            self.fail(f"a number or [lowest, highest]{bounds}")
        return Range(float(ends[0]), float(ends[1]))


def _is_number(value: Any) -> bool:
    """Return whether a value of the recipe file is a number below 1e300; True and False are not numbers."""
    # An integer with hundreds of digits cannot be converted to a float, so integers are compared before.
    return not isinstance(value, bool) and isinstance(value, int | float) and abs(value) < 1e300


def read_recipe(path: Path) -> Recipe:
    """Read the recipe of a generated dataset from a TOML file; paths in the file are relative to its folder.

    Raises RecipeError; CloudFileError and GapInputError for the files that the recipe names; OSError.
    """
    name = format_path(path)
    try:
        content = parse_toml(read_regular_file(path, MAX_FILE_BYTES))
    except TextError as error:
        raise RecipeError(name, error.position, error.expected, error.found, "correct the line") from None
    simple_keys = ("grasps", "seed", "shard", "fidelity", "sensing", "hand")
    range_types = {"grasp": GraspRanges, "simulator": SimulatorRanges, "sensor": SensorRanges}
    keys = Key(name, "", content).keys((*simple_keys, "object", *range_types, "report", "effect"))
    values: dict[str, Any] = {}
    for key, low, high in (("grasps", 1, MAX_GRASPS), ("seed", 0, 2**63 - 1), ("shard", 1, MAX_GRASPS_PER_SHARD)):
        if key in keys:
            values["grasps_per_shard" if key == "shard" else key] = keys[key].integer(low, high)
    for key, choices in (("fidelity", tuple(FIDELITIES)), ("sensing", LEVELS), ("hand", HANDS)):
        if key in keys:
            values[key] = keys[key].text(choices)
    for key, range_type in range_types.items():
        if key in keys:
            values[key] = _read_ranges(range_type(), keys[key])
    if "object" in keys:
        sizes = get_sizes(values.get("hand", DEFAULT_HAND))
        values["objects"] = _read_objects(keys["object"], path.parent, sizes)
    recipe = Recipe(**values)
    if "report" in keys:
        recipe = _add_report_table(recipe, keys["report"], path.parent)
    if "effect" in keys:
        fidelity, hand = FIDELITIES[recipe.fidelity], load_hand(recipe.hand)
        effects = tuple(_read_effect(table, fidelity, hand) for table in keys["effect"].items())
        recipe = replace(recipe, effects=recipe.effects + effects)
    return check_recipe(recipe, name)


def check_recipe(recipe: Recipe, file: str) -> Recipe:
    """Return the recipe unchanged. Raises RecipeError if its parts contradict each other.

    Contradictions are friction other than 0 with a sensing level other than "rigid", and objects or effects with equal
    names. file: name of the file, for messages.
    """
    if recipe.simulator.friction != fixed(0.0) and recipe.sensing != "rigid":
        expected, remedy = '0 unless sensing is "rigid"', 'set sensing = "rigid", or leave friction out'
        raise RecipeError(file, "simulator.friction", expected, "another value", remedy)
    repeated = _find_first_repeated([kind.name for kind in recipe.objects])
    if repeated is not None:
        raise RecipeError(file, "object", "each name once", format_value(repeated), "rename one")
    repeated = _find_first_repeated([effect.name for effect in recipe.effects])
    if repeated is not None:
        remedy = "take the effect either from the report or by name"
        raise RecipeError(file, "effect", "each effect once", f"{repeated} twice", remedy)
    return recipe


def _find_first_repeated(names: Sequence[str]) -> str | None:
    """Return the first name that occurs more than once; None if all names are different."""
    return next((name for name in names if names.count(name) > 1), None)


def add_report(recipe: Recipe, path: Path, widen: float = 1.0, share: float = 1.0) -> Recipe:
    """Return the recipe with the effects of the gap report `path` added. Raises GapInputError, RecipeError, OSError.

    widen: factor on the widths of the parameters' intervals. share: share of grasps with each effect.
    """
    effects = plan_report_effects(read_report(path), load_hand(recipe.hand), widen, share)
    return replace(recipe, effects=recipe.effects + effects)


def add_mesh(recipe: Recipe, path: Path, unit: str) -> Recipe:
    """Return the recipe with the mesh file `path` added as a kind of object, scaled by random factors of 0.9 to 1.1.

    unit: length unit of the file, a key of `UNITS`. Raises the errors of `read_mesh_kind`, and RecipeError if the file
    name cannot be the name of an object.
    """
    kind = read_mesh_kind(path, check_object_name(path.stem, str(path)), Range(0.9, 1.1), UNITS[unit])
    return replace(recipe, objects=(*recipe.objects, kind))


def check_object_name(text: str, file: str) -> str:
    """Return `text` if a dataset may use it as the name of an object. Raises RecipeError otherwise."""
    try:
        return check_name(text, Location(file))
    except DatasetError as error:
        raise RecipeError(file, "name", error.expected, error.found, error.remedy) from None


def _read_ranges(defaults: Ranges, table: Key) -> Ranges:
    """Replace default ranges by those in a table of the recipe file. Raises RecipeError for unsuitable values.

    defaults: default ranges of the grasp, the simulator or the sensor. Returns an object of the same type.
    """
    by_name = {field.name: getattr(defaults, field.name) for field in fields(defaults)}
    values: dict[str, Any] = {}
    for name, key in table.keys(tuple(by_name)).items():
        if isinstance(by_name[name], Range):
            values[name] = key.range(*_get_bounds(name))
        else:  # a probability, or a standard deviation in millimetres or degrees
            values[name] = key.number(0.0, 1.0 if name.endswith("share") else 90.0)
    result = replace(defaults, **values)
    if isinstance(result, SensorRanges):
        for name, key in table.keys(tuple(by_name)).items():
            for value in (getattr(result, name).low, getattr(result, name).high):
                try:
                    SimSensor(**{name: value})
                except SensorModelError as error:
                    key.fail(error.expected, found=error.found)
    return result


def _get_bounds(name: str) -> tuple[float, float]:
    """Return the lowest and the highest permitted value of the sampled quantity `name`, infinite without a bound."""
    bounds = {"turn_deg": (-360.0, 360.0), "grip": (0.0, 3.0), "friction": (0.0, 5.0), "layer_stiffness": (0.05, 20.0)}
    bounds |= {"thumb_deg": (-30.0, 30.0), "press_mm": (-20.0, 5.0)}
    return bounds.get(name, (-50.0, 50.0) if name.endswith("_mm") else (-np.inf, np.inf))


def _read_objects(table: Key, folder: Path, test_sizes: ObjectSizes) -> tuple[ObjectKind, ...]:
    """Read the kinds of objects of a recipe file. Raises RecipeError.

    folder: folder to which the paths of meshes are relative. test_sizes: sizes of the test objects; boxes and prisms of
    the recipe get the edge radius of the test object with the same shape.
    """
    items = table.items()
    if not 1 <= len(items) <= MAX_OBJECTS:
        table.fail(f"1 to {MAX_OBJECTS} kinds of objects", found=str(len(items)))
    return tuple(_read_object(item, folder, test_sizes) for item in items)


def _read_object(table: Key, folder: Path, test_sizes: ObjectSizes) -> ObjectKind:
    """Read one kind of object of a recipe file. Raises RecipeError for missing, unknown or unsuitable keys.

    folder: folder to which the path of a mesh is relative. test_sizes: sizes of the test objects; a box or a prism gets
    the edge radius of the test object with the same shape.
    """
    all_sizes = sorted({size for sizes in SIZES.values() for size in sizes})
    keys = table.keys(("name", "shape", "share", "approaches", "file", "unit", *all_sizes))
    for required in ("name", "shape"):
        if required not in keys:
            table.fail(f"a key {required}", "add it", "none")
    name = check_object_name(keys["name"].text(), table.file)
    shape = cast(Solid, keys["shape"].text(tuple(SIZES)))
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
        return read_mesh_kind(folder / keys["file"].text(), name, scale, unit, share)
    missing = [size for size in SIZES[shape] if size not in keys]
    if missing:
        table.fail(f"a key {missing[0]}", "add it", "none")
    sizes = {size: keys[size].range(5.0, 500.0) for size in SIZES[shape]}
    approaches = "thesis" if has_thesis_approaches(name) else "any"
    if "approaches" in keys:
        requested = keys["approaches"].text(("thesis", "any"))
        if requested == "thesis" and approaches == "any":
            keys["approaches"].fail(
                '"any" for an object that the thesis does not have', "rename the object, or use any"
            )
        approaches = requested
    edge_m = get_edge_m(shape, test_sizes)
    return ObjectKind(name, shape, sizes, share, cast(Approaches, approaches), edge_m=edge_m)


def _add_report_table(recipe: Recipe, table: Key, folder: Path) -> Recipe:
    """Return the recipe with the effects of the gap report that the table "report" names. Raises RecipeError.

    folder: folder to which the path of the report is relative.
    """
    keys = table.keys(("file", "widen", "share"))
    if "file" not in keys:
        table.fail("a key file", "name a report.json of taxel gap diagnose", "none")
    widen = keys["widen"].number(0.0, 100.0) if "widen" in keys else 1.0
    share = keys["share"].number(0.0, 1.0) if "share" in keys else 1.0
    return add_report(recipe, folder / keys["file"].text(), widen, share)


def _read_effect(table: Key, fidelity: Fidelity, hand: Hand) -> PlannedEffect:
    """Read an effect with the ranges of its parameters from a table "effect" of the recipe file. Raises RecipeError.

    fidelity: determines the duration of a grasp. hand: hand whose boards or taxels have the effect.
    """
    if not isinstance(table.value, dict):
        table.fail("a table")
    fixed_keys = ("name", "form", "scope", "share")
    keys = table.keys(tuple(table.value))
    if "name" not in keys:
        table.fail("a key name", "name an effect of the catalogue", "none")
    variant, scope = (keys[key].text() if key in keys else "" for key in ("form", "scope"))
    share = keys["share"].number(0.0, 1.0) if "share" in keys else 1.0
    ranges = {key: value.range() for key, value in keys.items() if key not in fixed_keys}
    moving_s = fidelity.timeline.duration_s - fidelity.timeline.baseline_s
    where = f"{table.file}: {table.path}"
    return plan_effect(where, keys["name"].text(), variant, scope, share, ranges, hand, moving_s)
