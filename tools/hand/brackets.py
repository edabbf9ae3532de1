"""Compute the taxel positions of the assumed hands (allegro, flat8, rig4) and write them into their descriptions.

These positions are derived from the shapes of the links: flat plates
on flat links, sheets around the corners of the finger links (65 taxels at 5 mm pitch exceed their 27.5 mm face), and
a strip over the dome of the fingertips. The tables are written below a marker line; the text above it is unchanged.

    python tools/hand/brackets.py [--check]
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from written_files import write_or_compare

from taxel.hand import BoardKind, load_hand
from taxel.types import FloatArray

DESCRIPTIONS = Path(__file__).parents[2] / "host/taxel/hand/descriptions"
MARKER = "# --- geometry: written by tools/hand/brackets.py"
PITCH_M = 0.005
BRACKET_M = 0.002  # thickness of a bracket between link and electrode (assumed)
TIP_RADIUS_M = 0.017  # of a fingertip bracket; the corners of the distal link's box are 16.9 mm from its axis
FACE_HALF_WIDTH_M = 0.01375 + BRACKET_M  # of a finger link with brackets on its flanks
BEND_RADIUS_M = 0.003  # of the flexible circuit at the corners of a link (assumed)
SLEEVE_RADIUS_M = 0.016  # of the bar under the wrapped board of the rig (assumed)
DOME_ROWS = 7  # TX 0..6 of a fingertip are on the dome, the other lines on the cylinder below it


def compute_sheet_coordinates(kind: BoardKind) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Compute the coordinates of each taxel on its flat sheet from the sheet's centre.

    Returns the coordinates to the distal end and to the left, f64[n] each, metres.
    """
    along = (0.5 * (kind.tx_count - 1) - kind.tx.astype(float)) * PITCH_M
    across = (0.5 * (kind.rx_count - 1) - kind.rx.astype(float)) * PITCH_M
    return along, across


def lay_flat(kind: BoardKind) -> FloatArray:
    """Return the positions and normals f64[n, 6] of the taxels of a flat board."""
    along, across = compute_sheet_coordinates(kind)
    zero = np.zeros_like(along)
    return np.column_stack([along, across, zero, zero, zero, zero + 1.0])


def lay_around_link(kind: BoardKind) -> FloatArray:
    """Return the positions and normals f64[n, 6] of the taxels of a sheet around a finger link's face and corners.

    From the middle outwards, the sheet covers the flat face, a quarter circle of radius `BEND_RADIUS_M` at the corner,
    and the flat flank (side) of the link. Frame: x to the distal end, y to the left, z out of the face.
    """
    along, across = compute_sheet_coordinates(kind)
    flat_half = FACE_HALF_WIDTH_M - BEND_RADIUS_M
    beyond = np.maximum(np.abs(across) - flat_half, 0.0)
    angle = np.minimum(beyond / BEND_RADIUS_M, 0.5 * np.pi)
    flank = np.maximum(beyond - 0.5 * np.pi * BEND_RADIUS_M, 0.0)
    side = np.sign(across)
    left = side * (np.minimum(np.abs(across), flat_half) + BEND_RADIUS_M * np.sin(angle))
    out = BEND_RADIUS_M * (np.cos(angle) - 1.0) - flank
    return np.column_stack([along, left, out, np.zeros_like(along), side * np.sin(angle), np.cos(angle)])


def lay_on_fingertip(kind: BoardKind) -> FloatArray:
    """Return the positions and normals f64[n, 6] of the taxels of a strip over a fingertip's dome.

    The strip continues around the cylinder below the dome. The origin is the centre of the dome.
    """
    _, across = compute_sheet_coordinates(kind)
    lateral = across / TIP_RADIUS_M
    row = kind.tx.astype(float)
    polar = np.where(row < DOME_ROWS, (DOME_ROWS - 0.5 - row) * PITCH_M / TIP_RADIUS_M, 0.0)
    below = np.where(row < DOME_ROWS, 0.0, (row - DOME_ROWS + 0.5) * PITCH_M)
    normal = np.column_stack([np.cos(lateral) * np.sin(polar), np.sin(lateral), np.cos(lateral) * np.cos(polar)])
    centre = np.column_stack([-below, np.zeros_like(below), np.zeros_like(below)])
    return np.hstack([centre + TIP_RADIUS_M * normal, normal])


def lay_around_bar(kind: BoardKind) -> FloatArray:
    """Return the positions and normals f64[n, 6] of the taxels of a sheet that is bent around a bar."""
    along, across = compute_sheet_coordinates(kind)
    angle = across / SLEEVE_RADIUS_M
    left, out = SLEEVE_RADIUS_M * np.sin(angle), SLEEVE_RADIUS_M * (np.cos(angle) - 1.0)
    return np.column_stack([along, left, out, np.zeros_like(along), np.sin(angle), np.cos(angle)])


ROW_FUNCTIONS: dict[str, Callable[[BoardKind], FloatArray]] = {
    "back_of_hand": lay_flat,
    "fingertip": lay_on_fingertip,
    "medial_back": lay_around_link,
    "medial_front": lay_flat,
    "palm": lay_flat,
    "proximal_back": lay_around_link,
    "proximal_front": lay_around_link,
    "flat8": lay_flat,
    "rig_slab": lay_flat,
    "rig_wall": lay_flat,
    "rig_dome": lay_on_fingertip,
    "rig_sleeve": lay_around_bar,
}


def format_geometry(kinds: dict[str, BoardKind]) -> str:
    """Return the generated part of a hand description: position and normal of each taxel, in the order of its map."""
    lines = [MARKER, "# Row: x, y, z of the electrode centre (metres) and its outward normal, in the bracket frame:"]
    lines += ["# z out of the skin, x to the distal end, y to the left seen from outside."]
    for name, kind in kinds.items():
        lines += ["", f"[geometry.{name}]", "taxels = ["]
        for row, tx in zip(ROW_FUNCTIONS[name](kind), kind.tx.tolist(), strict=True):
            # + 0.0 changes -0.0 to 0.0.
            numbers = ", ".join(f"{value + 0.0:.6f}" for value in np.round(row, 6))
            lines.append(f"    [{numbers}], # TX {tx}")
        lines.append("]")
    return "\n".join(lines) + "\n"


def format_descriptions() -> dict[Path, str]:
    """Return the text of each description whose geometry this program computes, by path."""
    texts = {}
    for path in sorted(DESCRIPTIONS.glob("*.toml")):
        text = path.read_text()
        if MARKER in text:
            kinds = {board.kind.name: board.kind for board in load_hand(path).boards}
            texts[path] = text.split(MARKER)[0].rstrip("\n") + "\n\n" + format_geometry(kinds)
    return texts


def main() -> int:
    """Write the geometry of the assumed hands, or with --check compare it; the exit status is 1 if a file differs."""
    return write_or_compare(format_descriptions(), __doc__.splitlines()[0])


if __name__ == "__main__":
    sys.exit(main())
