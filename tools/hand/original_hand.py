"""Write the descriptions of the original hand: three hands and the robot that carries them.

    python tools/hand/original_hand.py [--check]

Reads the figures in tools/hand/original. Writes `original`, `original_complete` and `first_generation` into the hand
descriptions and `ur5e_original` into the robot descriptions. --check only compares, exit status 1 if a file differs.
"""

import sys
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
from original_boards import OriginalKind, build_kind
from original_figures import OriginalBoard, compute_frames, read_boards, read_rows
from original_robot import LINKS, compute_link_frames, format_robot, map_to_palm
from written_files import write_or_compare

from taxel.hand.transforms import inverse, to_quaternion
from taxel.types import FloatArray

HAND_FOLDER: Final = Path(__file__).parents[2] / "host/taxel/hand"
KIND_CODES: Final = {
    "palm": 21,
    "back_of_hand": 22,
    "fingertip": 23,
    "medial_front": 24,
    "medial_back": 25,
    "proximal_front": 26,
    "proximal_back": 27,
    "thumb_medial_front": 28,
    "thumb_medial_back": 29,
}
FIRST_GENERATION_CODES: Final = {"Palm": 31, "BackOfHand": 32, "FingerTip": 33, "FingerBig": 34, "FingerSmall": 35}
FINGER_LINKS: Final = {"index": "ff", "middle": "mf", "pinkie": "rf", "thumb": "th"}
PART_LINKS: Final = {"proximal": "proximal", "medial": "medial", "fingertip": "distal", "thumb": "medial"}

ORIGINAL_HEADER: Final = """\
# The tactile skin of the original hand: {count} boards of {kinds} kinds, {taxels} taxels on a right Allegro hand.
#
# Written by tools/hand/original_hand.py from the figures in tools/hand/original. Facts: addresses, kinds, order,
# centres and normals of the taxels, and poses of the brackets; the frames are those of the original. Assumed: the TX
# and RX line of each taxel (rule: tools/hand/original_boards.py), the dielectric, the sheet beside the taxels, and that
# all boards of a finger are connected by one branch of the wiring. Pull-ups and capacitances: docs/star-wiring.md.
# {remark}
#
# A crossing map shows TX lines as rows and RX lines as columns, '#' a taxel. The index of a taxel is its position in
# reading order, which is the order of the counts in the original message. `layout` shows the indices as they lie on the
# unrolled board, seen from outside, distal side on top.

format = "taxel-hand"
version = 1
name = "{name}"
description = "{description}"
robot = "ur5e_original"

[taxel]
pitch_m = 0.005 # largest side of the square that one taxel measures
size_m = 0.003  # side of a square with the area of a pad; the pads are 3.2 to 3.4 mm by 2.8 to 2.9 mm
layer_m = 0.002 # dielectric over the electrode (assumed)
"""

FIRST_GENERATION_HEADER: Final = """\
# The first generation of the original skin (2021): 22 boards of 5 kinds, 224 taxels, one TX line for each board.
#
# Written by tools/hand/original_hand.py from tools/hand/original/first_generation_boards.csv. The positions of the
# taxels are in no file, so that this description contains no geometry. Board names are the links of the original host.

format = "taxel-hand"
version = 1
name = "first_generation"
description = "First generation of the original skin: 22 boards, 224 taxels"

[taxel]
pitch_m = 0.005 # assumed
size_m = 0.003  # assumed
"""


def format_crossings(tx: Sequence[int], rx: Sequence[int]) -> str:
    """Return the crossing map of a board kind: '#' for a taxel, '.' for an unused crossing.

    tx, rx: TX and RX line of each taxel.
    """
    crossings = np.full((max(tx) + 1, max(rx) + 1), ".")
    crossings[list(tx), list(rx)] = "#"
    return "\n".join("".join(row) for row in crossings)


def format_kind(name: str, code: int, tx: Sequence[int], rx: Sequence[int]) -> list[str]:
    """Return the lines of the table [kinds.NAME] of a hand description. tx, rx: TX and RX line of each taxel."""
    return [
        "",
        f"[kinds.{name}]",
        f"code = {code}",
        f"tx = {max(tx) + 1}",
        f"rx = {max(rx) + 1}",
        f"taxels = {len(tx)}",
        f'crossings = """\n{format_crossings(tx, rx)}\n"""',
    ]


def format_layout(kind: OriginalKind) -> str:
    """Return the indices of the taxels as they lie on the unrolled board; '.' where there is no taxel."""
    places = np.full((kind.row.max() + 1, kind.column.max() + 1), "  .", dtype="<U3")
    for index, place in enumerate(zip(kind.row.tolist(), kind.column.tolist(), strict=True)):
        places[place] = f"{index:3d}"
    return "\n".join(" ".join(row) for row in places)


def format_rows(name: str, rows: FloatArray) -> list[str]:
    """Return the lines of an array of numbers, rounded to 1 um (positions) and 1e-6 (directions).

    Spaces and zeros at the end of a number are omitted, because every recording contains the description, and its text
    is thereby 43 % shorter.
    """
    lines = [f"{name} = ["]
    for row in np.round(rows, 6) + 0.0:  # + 0.0 changes -0.0 to 0.0
        lines.append(f"[{','.join(format_short(value) for value in row.tolist())}],")
    return [*lines, "]"]


def format_short(value: float) -> str:
    """Return a number with at most six digits after the decimal point, without zeros at its end."""
    return f"{value:.6f}".rstrip("0").rstrip(".")


def format_geometry(kind: OriginalKind) -> list[str]:
    """Return the lines of the table [geometry.NAME] of a hand description."""
    return [
        "",
        f"[geometry.{kind.name}]",
        f'layout = """\n{format_layout(kind)}\n"""',
        *format_rows("taxels", kind.surface),
        *format_rows("margin", kind.margin),
    ]


def make_board_name(board: OriginalBoard) -> str:
    """Return the name of a board, such as "fingertip_index"; palm and back of the hand have no finger."""
    return board.kind if board.finger == "-" else f"{board.kind.removeprefix('thumb_')}_{board.finger}"


def make_link_name(board: OriginalBoard) -> str:
    """Return the name of the robot link that carries the board."""
    if board.finger == "-":
        return "palm"
    if board.finger == "thumb" and board.kind.startswith("proximal"):
        return "th_base"
    return f"{FINGER_LINKS[board.finger]}_{PART_LINKS[board.kind.split('_')[0]]}"


def make_branch_name(board: OriginalBoard) -> str:
    """Return the name of the branch of the I2C bus that connects the board: its finger, or the board itself.

    The hub is connected to the back of the hand, from which branches extend to the palm and to each finger (thesis,
    section 3.2).
    """
    return board.kind if board.finger == "-" else board.finger


@lru_cache(maxsize=1)
def compute_bracket_poses() -> dict[str, FloatArray]:
    """Return the pose f64[4, 4] of each bracket in its link, by board name.

    The thumb's proximal boards have no bracket in the original; they are assumed at the middle of the thumb's base.
    """
    original, links = compute_frames(), compute_link_frames()
    poses = {}
    for board in read_boards():
        link = make_link_name(board)
        if board.bracket in original:
            poses[board.name] = inverse(links[link]) @ map_to_palm(original[board.bracket])
        else:
            bracket = "ipf_bracket" if board.kind == "proximal_front" else "ipb_bracket"
            pose = inverse(links["ff_proximal"]) @ map_to_palm(original[bracket])
            pose[2, 3] -= 0.0125  # the base of the thumb begins below its joint
            poses[board.name] = pose
    return poses


def build_kinds(boards: Sequence[OriginalBoard]) -> list[OriginalKind]:
    """Build the kinds of the boards, each once, in ascending order of their codes.

    A board whose bracket is not in the original files is omitted.
    """
    frames = compute_frames()
    kinds = {}
    for board in boards:
        if board.kind not in kinds and board.bracket in frames:
            # Unit vector to the distal end of the finger (palm and back of the hand: z), in the palm's frame.
            upwards = np.array([0.0, 0.0, 1.0])
            if board.finger == "thumb":
                upwards = -frames[LINKS["th_medial"]][:3, 0]
            elif board.finger != "-":
                upwards = frames[LINKS[f"{FINGER_LINKS[board.finger]}_base"]][:3, 2]
            kinds[board.kind] = build_kind(board.kind, frames[board.bracket][:3, :3].T @ upwards)
    return sorted(kinds.values(), key=lambda kind: KIND_CODES[kind.name])


def format_hand(name: str, description: str, remark: str, boards: Sequence[OriginalBoard]) -> str:
    """Return the text of a hand description. remark: line of the header."""
    kinds = build_kinds(boards)
    taxels = sum(board.taxels for board in boards)
    header = ORIGINAL_HEADER.format(
        name=name, description=description, remark=remark, count=len(boards), kinds=len(kinds), taxels=f"{taxels:,}"
    )
    lines = [header.rstrip("\n")]
    for kind in kinds:
        lines += format_kind(kind.name, KIND_CODES[kind.name], kind.tx.tolist(), kind.rx.tolist())
    poses = compute_bracket_poses()
    for board in boards:
        pose = poses[board.name]
        lines += [
            "",
            "[[boards]]",
            f'name = "{make_board_name(board)}"',
            f'kind = "{board.kind}"',
            f"address = 0x{board.address:02X}",
            f'branch = "{make_branch_name(board)}"',
            f'link = "{make_link_name(board)}"',
            f"position_m = [{', '.join(f'{value + 0.0:.6f}' for value in np.round(pose[:3, 3], 6))}]",
            f"quaternion_wxyz = [{', '.join(f'{value + 0.0:.9f}' for value in np.round(to_quaternion(pose), 9))}]",
        ]
    lines += [
        "",
        "# Row: x, y, z of the electrode centre (metres), its outward normal, the direction to the distal end",
    ]
    lines += ["# and the sides of its square along that direction and across it (metres); in the bracket's frame."]
    lines += ["# `margin`: rectangles of bare sheet in the same form."]
    for kind in kinds:
        lines += format_geometry(kind)
    return "\n".join(lines) + "\n"


def format_first_generation() -> str:
    """Return the text of the description of the first-generation hand."""
    rows = read_rows("first_generation_boards")
    lines = [FIRST_GENERATION_HEADER.rstrip("\n")]
    for name, code in FIRST_GENERATION_CODES.items():
        taxels = next(int(row["taxels"]) for row in rows if row["kind"] == name)
        lines += format_kind(_make_snake_case(name), code, [0] * taxels, list(range(taxels)))
    for row in sorted(rows, key=lambda row: int(row["address"])):
        lines += [
            "",
            "[[boards]]",
            f'name = "board_{int(row["address"])}"',
            f'kind = "{_make_snake_case(row["kind"])}"',
            f"address = 0x{int(row['address']):02X} # {row['link']}",
        ]
    return "\n".join(lines) + "\n"


def _make_snake_case(name: str) -> str:
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name).lstrip("_")


def format_all() -> dict[Path, str]:
    """Return the text of each description that this program writes, by path."""
    boards = read_boards()
    fitted = [board for board in boards if board.is_fitted]
    hand = HAND_FOLDER / "descriptions"
    return {
        hand / "original.toml": format_hand(
            "original",
            "Original right Allegro hand: 17 boards, 1,037 taxels",
            "The thumb carries no board.",
            fitted,
        ),
        hand / "original_complete.toml": format_hand(
            "original_complete",
            "Original right Allegro hand with all designed boards: 22 boards, 1,324 taxels",
            "The boards of the thumb were never fitted; the poses of its two proximal boards are assumed.",
            boards,
        ),
        hand / "first_generation.toml": format_first_generation(),
        HAND_FOLDER / "robots" / "ur5e_original.toml": format_robot(
            (HAND_FOLDER / "robots" / "ur5e_allegro.toml").read_text()
        ),
    }


def main() -> int:
    """Write the descriptions, or with --check compare them; the exit status is 1 if a file differs."""
    return write_or_compare(format_all(), __doc__.splitlines()[0])


if __name__ == "__main__":
    sys.exit(main())
