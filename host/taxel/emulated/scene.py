"""A world file with a place for every taxel, and objects to touch (the words are in firmware/emulator/README.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import to_rotation_vector
from taxel.hand.world import WorldSettings, format_world


@dataclass(frozen=True)
class Scene:
    """Objects, and what is not where it is believed to be.

    objects: shapes by name; a scene stimulus calls them by their place in this mapping. bracket_offsets: f64[4, 4] by
    board name: where the bracket truly is, in the frame in which it is believed to be. object_offsets: the same by
    object name.
    """

    objects: Mapping[str, Shape]
    bracket_offsets: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    object_offsets: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


def scene_text(hand: Hand, scene: Scene, settings: WorldSettings | None = None) -> str:
    """The world file of `hand` and `scene` under `settings`. Raises HandGeometryError without taxel positions."""
    if hand.layer_m is None:
        raise HandGeometryError(hand.name)
    lines = [f"layer {hand.layer_m!r}", "# surface board x y z nx ny nz dx dy dz (d: the taxel's distal side)"]
    places = np.hstack([hand.position, hand.normal, hand.distal])
    for board in hand.boards:
        lines += [f"surface 0x{board.address:02X} {_numbers(row)}" for row in places[hand.get_slice(board.address)]]
    lines += _margin_lines(hand)
    for name, shape in scene.objects.items():
        lines += _object_lines(name, shape)
    for name, offset in scene.bracket_offsets.items():
        lines.append(f"bracket_offset 0x{hand.find_board(name).address:02X} {_offset(offset)}")
    for name, offset in scene.object_offsets.items():
        lines.append(f"object_offset {name} {_offset(offset)}")
    return format_world(hand, settings) + "\n".join(lines) + "\n"


def _margin_lines(hand: Hand) -> list[str]:
    sheet = build_sheet(hand)
    bare = slice(hand.n_taxels, None)
    rows = np.hstack([sheet.position[bare], sheet.normal[bare], sheet.distal[bare]])
    addresses = [hand.boards[index].address for index in sheet.board_index[bare].tolist()]
    return [f"margin 0x{address:02X} {_numbers(row)}" for address, row in zip(addresses, rows, strict=True)]


def _object_lines(name: str, shape: Shape) -> list[str]:
    low, high = shape.bounds
    centre = 0.5 * (low + high)
    lines = [f"object {name} {_numbers(centre)} {float(0.5 * np.linalg.norm(high - low))!r}"]
    if isinstance(shape, Cylinder):
        return [*lines, f"cylinder {shape.radius!r} {shape.height!r}"]
    if isinstance(shape, ConvexPolytope):
        planes = np.column_stack([shape.normals, shape.offsets])
        return [*lines, *(f"plane {_numbers(plane)}" for plane in planes)]
    raise TypeError(f"the emulator knows convex polytopes and cylinders, not {type(shape).__name__}")


def _offset(offset: NDArray[np.float64]) -> str:
    return f"{_numbers(offset[:3, 3])} {_numbers(to_rotation_vector(offset))}"


def _numbers(values: NDArray[np.float64]) -> str:
    return " ".join(f"{value:.12g}" for value in values.tolist())
