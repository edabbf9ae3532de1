"""Draw docs/images/data-flow.svg and docs/images/layers.svg: `python tools/docs/draw_architecture.py`.

The layers are read from the import contract in pyproject.toml. With `--check` nothing is written, and the exit status
is 1 if a drawing is not up to date.
"""

import argparse
import sys
import tomllib
from pathlib import Path
from typing import Final

from svg_drawing import Drawing

ROOT: Final = Path(__file__).resolve().parents[2]
IMAGES: Final = ROOT / "docs" / "images"
CONTRACT: Final = "A package imports only packages of lower layers"

NOTES: Final = {
    "taxel.blind": "accuracy of the diagnosis",
    "taxel.campaign": "grasps on three kinds of hand",
    "taxel.cli": "the command taxel: arguments and printing",
    "taxel.cloud": "contact clouds, alignment, shapes",
    "taxel.demonstration": "scripted contacts",
    "taxel.original_hub": "stream of the original hub as frames of the project",
    "taxel.emulated": "scene and contact of the emulated skin",
    "taxel.gap": "diagnosis of the gap",
    "taxel.generate": "synthetic grasps at scale",
    "taxel.output": "files that survive a crash",
    "taxel.planning": "motions without collisions",
    "taxel.grasp": "objects, approaches, grasp plan, calibration",
    "taxel.hand": "hand description, taxel positions, kinematics, drivers of hand and arm",
    "taxel.link": "bytes in and out: serial port, I2C, CAN, emulator, recording",
    "taxel.input_files": "regular files, TOML, JSON, CSV and arrays with limits",
    "taxel.monitor": "live view",
    "taxel.recording": "recordings, grasp datasets",
    "taxel.ros": "ROS messages, MCAP, nodes",
    "taxel.signal": "baseline, activation, events, noise",
    "taxel.proximity": "targets before contact",
    "taxel.sim": "simulated hand (MuJoCo)",
    "taxel.skin": "taxel.open: link, decoder and hand description in one object",
    "taxel.stream": "decoding of frames, clocks, loss counters",
    "taxel.thesis": "chapter 5 of the thesis",
    "taxel.twin": "a live skin beside its reference",
    "taxel_protocol": "definitions of all messages",
    "taxel_tools": "commands for boards: scan, provision, flash, bench",
}
"""Content of each package, in a few words."""

WIDTH: Final = 880


def draw_data_flow() -> str:
    """Return the SVG text of the picture that shows the path of the data from the contact to the report."""
    drawing = Drawing(WIDTH, 958, "Data flow of taxel: contact, firmware, host library, simulator, diagnosis, report")
    left_x, box_width, box_height, step = 44, 380, 50, 86
    right_x, right_width = 540, 280
    full_width = right_x + right_width - left_x
    top = 156
    drawing.draw_box(
        left_x, 24, right_x + right_width - left_x, box_height, "grasp, campaign", "one plan of grasps for both sides"
    )
    drawing.draw_group(24, 116, 420, 3 * step + 20, "blue", "firmware/ (C11)")
    drawing.draw_group(24, 116 + 3 * step + 36, 420, 5 * step + 20, "green", "host/taxel (Python)")
    drawing.draw_group(520, 116, 320, 3 * step + 20, "orange", "host/taxel/sim")
    firmware = (
        ("emulator, or physical skin", "elastic layer and capacitance of each taxel", "analogue value"),
        ("sensor", "scan of all taxels, snapshots with CRC-32", "I2C: raw counts"),
        ("hub", "polls the boards, frames with CRC-32", "UART: bytes"),
    )
    host = (
        ("link", "opens a URL: port, emulator or recording", "bytes with arrival times"),
        ("stream", "deframing, decoding, clocks, losses", "TaxelFrame of one board"),
        ("skin", "joins the boards of a poll cycle", "SkinFrame of one cycle"),
        ("signal, hand", "baseline, active taxels, 3-D positions", "signals and poses"),
        ("recording", "grasp dataset real.h5", ""),
    )
    middle = left_x + box_width / 2
    tops = [top + number * step for number in range(3)] + [top + 36 + number * step for number in range(3, 8)]
    drawing.draw_arrow((middle, 74), (middle, top))
    drawing.draw_text("label", middle + 10, 104, "contact forces", 160)
    for y, following, (name, note, label) in zip(tops, [*tops[1:], 0], (*firmware, *host), strict=True):
        drawing.draw_box(left_x, y, box_width, box_height, name, note)
        if label:
            drawing.draw_arrow((middle, y + box_height), (middle, following))
            drawing.draw_text("label", middle + 10, y + box_height + 22, label, 190)
    simulator = (
        ("motion", "rigid bodies, joints, free object", "poses"),
        ("contact", "springs of the elastic layer", "force on each taxel"),
        ("sensor model", "signal as a function of force", ""),
    )
    centre = right_x + right_width / 2
    drawing.draw_arrow((centre, 74), (centre, top))
    for y, following, (name, note, label) in zip(tops[:3], [*tops[1:3], 0], simulator, strict=True):
        drawing.draw_box(right_x, y, right_width, box_height, name, note)
        if label:
            drawing.draw_arrow((centre, y + box_height), (centre, following))
            drawing.draw_text("label", centre + 10, y + box_height + 22, label, 160)
    drawing.draw_box(right_x, tops[7], right_width, box_height, "recording", "grasp dataset sim.h5")
    arrow_x = right_x + right_width - 24
    drawing.draw_arrow((arrow_x, tops[2] + box_height), (arrow_x, tops[7]))
    drawing.draw_text("label", arrow_x - 120, tops[7] - 14, "raw counts", 110)
    for number, (name, note) in enumerate((("monitor", "live view"), ("ros", "topics, MCAP files"))):
        y = tops[4] + 18 + number * step
        drawing.draw_box(right_x, y, 200, box_height, name, note)
        turn = 490
        drawing.draw_arrow((left_x + box_width, tops[5] + 25), (turn, tops[5] + 25), (turn, y + 25), (right_x, y + 25))
    bottom = tops[7] + box_height
    result = "location, cause and reduction of the gap: report.json, report.html"
    drawing.draw_box(left_x, bottom + 40, full_width, box_height, "gap", result)
    drawing.draw_arrow((middle, bottom), (middle, bottom + 40))
    drawing.draw_arrow((centre, bottom), (centre, bottom + 40))
    return drawing.to_svg()


def draw_layers() -> str:
    """Return the SVG text of the picture of the import contract's layers, highest layer first."""
    layers = read_layers()
    height, step, left_x = 46, 56, 60
    drawing = Drawing(WIDTH, 92 + step * (len(layers) + 1), "Layers of the Python packages, highest first")
    drawing.draw_text("title", 20, 32, "A package imports only packages of lower rows.", WIDTH - 40)
    space = WIDTH - left_x - 20
    y = 48
    drawing.draw_group(left_x, y, space, height, "violet", "")
    programs = "tools/, hil_tests/, examples/: programs that use the packages"
    drawing.draw_text("note", left_x + space / 2, y + 28, programs, space, is_centred=True)
    for number, packages in enumerate(layers):
        y += step
        drawing.draw_text("title", 20, y + 28, str(len(layers) - number), 30)
        width = (space - 12 * (len(packages) - 1)) // len(packages)
        for column, package in enumerate(packages):
            drawing.draw_box(left_x + column * (width + 12), y, width, height, package, NOTES[package])
    y += step
    drawing.draw_text(
        "label", left_x, y + 20, "firmware/ uses the C header that is generated from taxel_protocol.", space
    )
    return drawing.to_svg()


def read_layers() -> list[list[str]]:
    """Read the packages of each layer of the import contract in pyproject.toml, highest layer first."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (layers,) = (contract["layers"] for contract in contracts if contract["name"] == CONTRACT)
    return [[name.strip(" ()") for name in layer.split("|")] for layer in layers]


def draw_all() -> dict[Path, str]:
    """Draw all pictures of the architecture and return the SVG text of each, by path."""
    return {IMAGES / "data-flow.svg": draw_data_flow(), IMAGES / "layers.svg": draw_layers()}


def find_stale_drawings() -> list[str]:
    """Return one message for each picture of the architecture that is not up to date."""
    return [
        f"{path.relative_to(ROOT)} is not up to date; run python tools/docs/draw_architecture.py"
        for path, text in draw_all().items()
        if not path.is_file() or path.read_text() != text
    ]


def main() -> int:
    """Write the pictures of the architecture, or with --check report stale ones; the exit status is then 1."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="report drawings that are not up to date")
    if parser.parse_args().check:
        stale = find_stale_drawings()
        print("\n".join(stale), file=sys.stderr)
        return 1 if stale else 0
    for path, text in draw_all().items():
        path.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
