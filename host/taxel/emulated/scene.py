"""World files with taxel poses and objects. firmware/emulator/README.md describes the keywords of the format."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.transforms import to_rotation_vector
from taxel.hand.world import WorldSettings, format_surface, format_world, has_layout
from taxel.types import FloatArray


@dataclass(frozen=True)
class EmulatedScene:
    """Objects of a world, and how far the true poses of brackets and objects are from their nominal poses.

    objects: shapes by name; a stimulus file refers to an object by its position in this mapping. bracket_offsets:
    f64[4, 4] by board name, true pose of the bracket in its nominal frame. object_offsets: f64[4, 4] by object name,
    true pose of the object in its nominal frame.
    """

    objects: Mapping[str, Shape]
    bracket_offsets: Mapping[str, FloatArray] = field(default_factory=dict)
    object_offsets: Mapping[str, FloatArray] = field(default_factory=dict)


def format_scene(hand: Hand, scene: EmulatedScene, settings: WorldSettings | None = None) -> str:
    """Format the emulator's world file of a hand and a scene with objects.

    settings: None: default settings. Raises HandGeometryError if the hand has no taxel positions or no layer thickness,
    and TypeError for a shape that the emulator does not support.
    """
    if hand.layer_m is None:
        raise HandGeometryError(hand.name)
    lines = [f"layer {hand.layer_m!r}"]
    # With a layout, the text of `format_world` already contains the surface.
    lines += [] if has_layout(hand) else format_surface(hand)
    for name, shape in scene.objects.items():
        lines += _format_object(name, shape)
    for name, offset in scene.bracket_offsets.items():
        lines.append(f"bracket_offset 0x{hand.find_board(name).address:02X} {_format_offset(offset)}")
    for name, offset in scene.object_offsets.items():
        lines.append(f"object_offset {name} {_format_offset(offset)}")
    return format_world(hand, settings) + "\n".join(lines) + "\n"


def _format_object(name: str, shape: Shape) -> list[str]:
    """Format the world-file lines of an object: name and bounding sphere, then the shape.

    Raises TypeError for an unsupported shape.
    """
    low, high = shape.bounds
    centre = 0.5 * (low + high)
    lines = [f"object {name} {_format_numbers(centre)} {float(0.5 * np.linalg.norm(high - low))!r}"]
    if isinstance(shape, Cylinder):
        return [*lines, f"cylinder {shape.radius!r} {shape.height!r}"]
    if isinstance(shape, ConvexPolytope):
        planes = np.column_stack([shape.normals, shape.offsets])
        return [*lines, *(f"plane {_format_numbers(plane)}" for plane in planes)]
    raise TypeError(f"object {name}: the emulator supports ConvexPolytope and Cylinder, found {type(shape).__name__}")


def _format_offset(offset: FloatArray) -> str:
    """Format a displacement f64[4, 4] as six numbers: translation in metres, then rotation vector in radians."""
    return f"{_format_numbers(offset[:3, 3])} {_format_numbers(to_rotation_vector(offset))}"


def _format_numbers(values: FloatArray) -> str:
    """Format numbers for a line of the world file, with 12 digits, separated by spaces."""
    return " ".join(f"{value:.12g}" for value in values.tolist())
