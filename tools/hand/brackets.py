"""Lay the packaged hands' crossing maps over their links and write the taxels' places into the description files.

The CAD model of the brackets is not published, so the places are made here from the extents of the links: flat plates
where the link is flat, sheets wrapped round the corners of the finger links (65 taxels at 5 mm exceed their 27.5 mm
face), and a strip over the dome of the fingertips. Arrays are written below a marker line; everything above it is kept.

    python tools/hand/brackets.py [--check]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind, load_hand
from taxel.types import FloatArray

DESCRIPTIONS = Path(__file__).parents[2] / "host/taxel/hand/descriptions"
MARKER = "# --- geometry: written by tools/hand/brackets.py"
PITCH_M = 0.005
BRACKET_M = 0.002  # thickness of a bracket between link and electrode (assumed)
TIP_RADIUS_M = 0.017  # of a fingertip's bracket: clears the corners of the distal link's box, 16.9 mm from its axis
FACE_HALF_WIDTH_M = 0.01375 + BRACKET_M  # of a finger link with brackets on its flanks
BEND_RADIUS_M = 0.003  # to which the flexible circuit is bent round a link's corner (assumed)
SLEEVE_RADIUS_M = 0.016  # of the bar under the rig's wrapped board (assumed)
DOME_ROWS = 7  # TX 0..6 of a fingertip run over the dome, the others over the cylinder below it


def along_and_across(kind: BoardKind) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance of each taxel from the middle of the sheet, metres: to the distal end, and to the left."""
    along = (0.5 * (kind.tx_count - 1) - kind.tx.astype(float)) * PITCH_M
    across = (0.5 * (kind.rx_count - 1) - kind.rx.astype(float)) * PITCH_M
    return along, across


def flat(kind: BoardKind) -> FloatArray:
    """A plate."""
    along, across = along_and_across(kind)
    zero = np.zeros_like(along)
    return np.column_stack([along, across, zero, zero, zero, zero + 1.0])


def wrapped(kind: BoardKind) -> FloatArray:
    """A sheet over the face of a finger link and round both its corners, unrolled across the finger."""
    along, across = along_and_across(kind)
    flat_half = FACE_HALF_WIDTH_M - BEND_RADIUS_M
    beyond = np.maximum(np.abs(across) - flat_half, 0.0)
    angle = np.minimum(beyond / BEND_RADIUS_M, 0.5 * np.pi)
    flank = np.maximum(beyond - 0.5 * np.pi * BEND_RADIUS_M, 0.0)
    side = np.sign(across)
    left = side * (np.minimum(np.abs(across), flat_half) + BEND_RADIUS_M * np.sin(angle))
    out = BEND_RADIUS_M * (np.cos(angle) - 1.0) - flank
    return np.column_stack([along, left, out, np.zeros_like(along), side * np.sin(angle), np.cos(angle)])


def fingertip(kind: BoardKind) -> FloatArray:
    """A strip over the dome and petals round the cylinder below it; the frame's origin is the dome's centre."""
    _, across = along_and_across(kind)
    lateral = across / TIP_RADIUS_M
    row = kind.tx.astype(float)
    polar = np.where(row < DOME_ROWS, (DOME_ROWS - 0.5 - row) * PITCH_M / TIP_RADIUS_M, 0.0)
    below = np.where(row < DOME_ROWS, 0.0, (row - DOME_ROWS + 0.5) * PITCH_M)
    normal = np.column_stack([np.cos(lateral) * np.sin(polar), np.sin(lateral), np.cos(lateral) * np.cos(polar)])
    centre = np.column_stack([-below, np.zeros_like(below), np.zeros_like(below)])
    return np.hstack([centre + TIP_RADIUS_M * normal, normal])


def sleeve(kind: BoardKind) -> FloatArray:
    """A sheet round a bar."""
    along, across = along_and_across(kind)
    angle = across / SLEEVE_RADIUS_M
    left, out = SLEEVE_RADIUS_M * np.sin(angle), SLEEVE_RADIUS_M * (np.cos(angle) - 1.0)
    return np.column_stack([along, left, out, np.zeros_like(along), np.sin(angle), np.cos(angle)])


SHEETS: dict[str, Callable[[BoardKind], FloatArray]] = {
    "back_of_hand": flat,
    "fingertip": fingertip,
    "medial_back": wrapped,
    "medial_front": flat,
    "palm": flat,
    "proximal_back": wrapped,
    "proximal_front": wrapped,
    "flat8": flat,
    "rig_slab": flat,
    "rig_wall": flat,
    "rig_dome": fingertip,
    "rig_sleeve": sleeve,
}


def geometry_text(kinds: dict[str, BoardKind]) -> str:
    """The generated part of a description: one line a taxel, in the order of its map, TX rows apart."""
    lines = [MARKER, "# A row is x, y, z of the electrode's centre (metres) and its outward normal, in the bracket's"]
    lines += ["# frame: z out of the skin, x to the distal end, y to the left as seen from outside."]
    for name, kind in kinds.items():
        lines += ["", f"[geometry.{name}]", "taxels = ["]
        for row, tx in zip(SHEETS[name](kind), kind.tx.tolist(), strict=True):
            numbers = ", ".join(f"{value + 0.0:.6f}" for value in np.round(row, 6))
            lines.append(f"    [{numbers}], # TX {tx}")
        lines.append("]")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write the geometry of every packaged hand, or with --check only compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; status 1 if a file is stale")
    check = parser.parse_args().check
    stale = []
    for path in sorted(DESCRIPTIONS.glob("*.toml")):
        text = path.read_text()
        kinds = {board.kind.name: board.kind for board in load_hand(path).boards}
        wanted = text.split(MARKER)[0].rstrip("\n") + "\n\n" + geometry_text(kinds)
        if text != wanted:
            stale.append(path.name)
            if not check:
                path.write_text(wanted)
    if stale:
        print(f"{'stale' if check else 'written'}: {', '.join(stale)}")
    return 1 if check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
