"""The diagnosis on measured touches: a recording against itself, and against itself without its known faults.

    python tools/gap/capfingerid.py --out DIR [--data DIR] [--splits 20] [--seed 0]

--data: a folder of CapMatrix_<name>.txt; without it the recordings that come with the library. DIR gets the datasets,
the reports and `capfingerid.json`. No sim-to-real claim is made: both files of every pair are the same recording.

How recordings become grasps. The panel is one board: rows are TX, columns are RX. An object is a finger (one recording
each), an approach is one touch of the task TAP, named with the row on which it lies: the finger is laid on a place,
stays for about 25 frames and is lifted. No touch is made twice at a place, and a mean over places scatters by more than
any fault of the frames. So what is repeated is the look: successive frames are taken in blocks, and of each block every
look gets one, at random. A session is the looks of one number. Looks scatter by the frames' noise, impulses and finger
motion, not by what a second touch would; that suffices to ask what the diagnosis says of two files.

Phases come from the mended frames, since no command was logged: baseline, ten blocks at rest before the touch (also
from earlier pauses); closing, the first block in which the finger lies there; hold, the blocks after that; release, the
block from the first frame without it. There is no recovery: the next touch comes too soon. Frames that repeat the one
before, time and all, are left out. A look's frames carry the times of their blocks.

What is compared: (1) half the looks against the other half, over many random dealings; (2) the measured frames against
the same frames without stale prefixes and impulses, without one of them, and prefixes alone against neither.
"""

import argparse
import json
import runpy
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from measured_touches import CELLS, ROW_OF_CELL, Frames, Look, halves, held_touches, looks_at

from taxel.errors import TaxelError
from taxel.gap.diagnosis import diagnose
from taxel.recording import (
    DatasetHeader,
    GraspDatasetWriter,
    GraspRecord,
    ObjectMesh,
    SensorTable,
    TaxelTable,
    TouchRecording,
    load_recording,
    recordings,
)
from taxel.recording.capfingerid import COLUMNS, ROWS
from taxel.types import FloatArray

LOOKS: Final = 8
"""Half of them are four sessions. With three, intervals are so wide that two halves of six look like two recordings."""

PITCH_M: Final = 0.0041
"""Between cells: a Nexus 5 has 15 x 27 electrodes of 4.1 mm (H. V. Le, huyle.de/blog/capacitive-images)."""

ADDRESS: Final = 0x20
REST_RAW_COUNTS: Final = 30_000.0
"""The recordings tell counts above a baseline that they do not tell; contact lowers a raw count."""

FINGER_M: Final = 0.008
BELIEVED: Final = 0.05
"""Corrected p-value under which a place counts as found."""

MOST_ELSEWHERE: Final = 0.05
"""Share of the excess that may lie off the torn rows."""

RESEMBLED: Final = ("noise", "dropout", "latency", "baseline_drift", "hysteresis")
"""What the faults look like: jumps are noise, cells that do not follow are dropout or late, what stays is drift."""


@dataclass(frozen=True)
class Comparison:
    """Two versions of the same frames. expected: whether the diagnosis has to find a gap, or none."""

    name: str
    first: str
    second: str
    gap: bool


COMPARISONS: Final = (
    Comparison("both", "measured", "mended", True),
    Comparison("stale prefixes", "measured", "without_prefixes", True),
    Comparison("impulses", "measured", "without_impulses", True),
    Comparison("prefixes that hold no impulse", "without_impulses", "mended", False),
)


def panel() -> tuple[TaxelTable, SensorTable]:
    """The panel as one board of 27 x 15 taxels."""
    row, column = ROW_OF_CELL, np.arange(CELLS) % COLUMNS
    place = np.column_stack([-PITCH_M * row, -PITCH_M * column, np.zeros(CELLS)])
    taxels = TaxelTable(
        np.full(CELLS, ADDRESS, np.uint8),
        row.astype(np.uint8),
        column.astype(np.uint8),
        place,
        np.tile([0.0, 0.0, 1.0], (CELLS, 1)),
        np.full(CELLS, PITCH_M),
    )
    return taxels, SensorTable(np.array([ADDRESS], np.uint8), ("panel",), ("panel",), np.array([14.0]))


def finger() -> ObjectMesh:
    """A box: nothing is known of the finger's shape, and nothing is worked out from it."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)]) * FINGER_M
    faces = [[0, 2, 4], [2, 6, 4], [1, 5, 3], [3, 5, 7], [0, 1, 2], [1, 3, 2]]
    faces += [[4, 6, 5], [5, 6, 7], [0, 4, 1], [1, 4, 5], [2, 3, 6], [3, 7, 6]]
    return ObjectMesh(corners, np.array(faces, np.int32))


def write_looks(path: Path, looks: list[Look], version: str) -> None:
    """One dataset of some looks. version: which of the `Frames`' counts."""
    taxels, sensors = panel()
    objects = {look.touch.frames.name: finger() for look in looks}
    with GraspDatasetWriter.create(
        path,
        DatasetHeader(
            source="real",
            hand="touch panel",
            taxels=taxels,
            sensors=sensors,
            objects=objects,
            generator=f"tools/gap/capfingerid.py, {version}",
        ),
        overwrite=True,
    ) as out:
        for number, look in enumerate(looks):
            counts: FloatArray = getattr(look.touch.frames, version)[look.frames]
            record = GraspRecord(
                object=look.touch.frames.name,
                approach=f"touch_{look.touch.number:03d}_row_{look.touch.row:02d}",
                iteration=0,
                session=look.number,
                timestamp=look.time_s,
                phase=look.phase,
                raw_counts=np.rint(REST_RAW_COUNTS - counts).astype(np.uint16),
                valid=np.ones((len(look.frames), 1), bool),
                sensor_pose=np.eye(4)[None],
                object_pose=np.eye(4),
            )
            out.add(record, f"{number:05d}")


def deal(every: Iterable[Frames], seed: int, most: int | None = None) -> list[Look]:
    """Looks at the touches of some recordings; most: touches of each recording."""
    rng = np.random.default_rng(seed)
    looks = []
    for frames in every:
        dealt = [looks_at(touch, LOOKS, rng) for touch in held_touches(frames)]
        looks += [look for own in [own for own in dealt if own][:most] for look in own]
    return looks


def split_half(folder: Path, looks: list[Look]) -> dict[str, Any]:
    """Half the looks against the other half: what the diagnosis says."""
    first, other = folder / "first_half.h5", folder / "other_half.h5"
    for path, half in zip((first, other), halves(looks), strict=True):
        write_looks(path, half, "measured")
    return said(diagnose(first, other).report)


def said(report: dict[str, Any]) -> dict[str, Any]:
    """What the table needs of a report."""
    rows = [line for line in report["where"]["lines"] if line["axis"] == "tx"]
    return {
        "status": report["verdict"]["status"],
        "effects": report["verdict"]["effects"],
        "one_line": report["verdict"]["one_line"],
        "gap": report["gap"]["value"],
        "floor": report["gap"]["floor"],
        "excess": report["gap"]["excess"],
        "rows": {str(line["index"]): round(line["share"], 4) for line in rows},
        "rows_found": sorted(line["index"] for line in rows if line["p_value"] < BELIEVED),
        "phases": {one["phase"]: round(one["share"], 4) for one in report["where"]["phases"]},
        "phases_found": [one["phase"] for one in report["where"]["phases"] if one["p_value"] < BELIEVED],
    }


def compare(folder: Path, looks: list[Look], wanted: Comparison) -> dict[str, Any]:
    """A version of the frames against another, and whether the diagnosis says the right thing of the right place."""
    for version in (wanted.first, wanted.second):
        if not (folder / f"{version}.h5").exists():
            write_looks(folder / f"{version}.h5", looks, version)
    report = diagnose(folder / f"{wanted.first}.h5", folder / f"{wanted.second}.h5").report
    name = wanted.name.replace(" ", "_")
    (folder / f"report_{name}.json").write_text(json.dumps(report, allow_nan=False))
    result, place = said(report), differing(looks, wanted)
    share = sum(result["rows"][str(row)] for row in place["rows"])
    found = result["rows_found"]
    at_place = share >= 1.0 - MOST_ELSEWHERE and set(found) <= set(place["rows"]) and place["worst_row"] in found
    blamed = set(result["effects"]) <= {*RESEMBLED, "unknown"} and result["status"] != "no_gap"
    right = blamed and at_place if wanted.gap else result["status"] == "no_gap"
    return {**result, "differs": place, "share_on_rows": share, "at_place": at_place, "right": right}


def differing(looks: list[Look], wanted: Comparison) -> dict[str, Any]:
    """Where the frames of the looks differ, from the frames alone: rows, the worst, mean square by row and phase."""
    squares: FloatArray = np.zeros((4, ROWS))
    for phase in range(4):
        parts = []
        for frames in {look.touch.frames.name: look.touch.frames for look in looks}.values():
            own = [look.frames[look.phase == phase] for look in looks if look.touch.frames is frames]
            rows = np.concatenate(own)
            parts.append((getattr(frames, wanted.first)[rows] - getattr(frames, wanted.second)[rows]) ** 2)
        mean = np.concatenate(parts).mean(axis=0)
        squares[phase] = np.bincount(ROW_OF_CELL, mean, ROWS) / COLUMNS
    by_row = squares.mean(axis=0)
    names = ("baseline", "closing", "hold", "release")
    return {
        "rows": np.flatnonzero(by_row > 0).tolist(),
        "worst_row": int(by_row.argmax()),
        "rms_by_row": np.sqrt(by_row).round(2).tolist(),
        "rms_by_phase": dict(zip(names, np.sqrt(squares.mean(axis=1)).round(2).tolist(), strict=True)),
    }


def run(folder: Path, every: list[Frames], splits: int, seed: int, show: Callable[[str], None]) -> dict[str, Any]:
    """All comparisons. splits: random dealings, with the seeds from `seed` on."""
    looks = deal(every, seed)
    touches = len(looks) // LOOKS
    result: dict[str, Any] = {
        "recordings": {frames.name: frames.figures() for frames in every},
        "touches": touches,
        "looks": LOOKS,
    }
    show(f"{touches} touches, {LOOKS} looks each; no sim-to-real claim: both files are of the same recording")
    show(f"{'missing in the comparison':<32}{'gap':>7}{'floor':>7}  {'rows':<14}{'share there':>12}  verdict")
    result["faults"] = {}
    for wanted in COMPARISONS:
        row = result["faults"][wanted.name] = compare(folder, looks, wanted)
        verdict = " ".join([row["status"], *(name for name in row["effects"] if name != row["status"])])
        where = ", ".join(str(one) for one in row["rows_found"]) or "-"
        judged = "as expected" if row["right"] else "NOT AS EXPECTED"
        text = f"{wanted.name:<32}{row['gap']:7.1f}{row['floor']:7.1f}  {where:<14}{row['share_on_rows']:12.0%}"
        show(f"{text}  {verdict}: {judged}")
    result["splits"] = []
    for number in range(seed, seed + splits):
        row = {"seed": number, **split_half(folder, deal(every, number))}
        result["splits"].append(row)
        show(f"split-half, seed {number:<14}{row['gap']:14.1f}{row['floor']:7.1f}{'':28}  {row['status']}")
    none = sum(row["status"] == "no_gap" for row in result["splits"])
    result["no_gap_rate"] = none / splits if splits else None
    show(f"split-half: no_gap in {none} of {splits}")
    return result


def recordings_of(data: Path | None) -> list[Frames]:
    """Of a folder of text files, or those that come with the library."""
    if data is None:
        return [Frames.of(load_recording(name)) for name in recordings()]
    importer = runpy.run_path(str(Path(__file__).resolve().parents[1] / "import_capfingerid.py"))
    paths = sorted(data.glob("CapMatrix_*.txt"))
    if not paths:
        raise TaxelError(f"{data}: expected CapMatrix_<name>.txt, found none; give the folder of the recordings")
    every = []
    for path in paths:
        try:
            read = importer["read_recording"](path)
        except importer["FormatError"] as error:
            raise TaxelError(str(error)) from error
        time = (read.time_ns - read.time_ns[0]) / 1e9
        every.append(Frames.of(TouchRecording(path.stem.removeprefix("CapMatrix_"), time, read.values, read.task)))
    return every


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description="The diagnosis on measured touches; see the file's first lines.")
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder of CapMatrix_<name>.txt")
    parser.add_argument("--out", type=Path, metavar="DIR", required=True, help="a new folder")
    parser.add_argument("--splits", type=int, default=20, metavar="N", help="random halves (20)")
    parser.add_argument("--seed", type=int, default=0, help="of the first split (0)")
    options = parser.parse_args()
    try:
        every = recordings_of(options.data)
        options.out.mkdir(parents=True)
        result = run(options.out, every, options.splits, options.seed, lambda line: print(line, flush=True))
    except FileExistsError:
        print(f"capfingerid: {options.out}: exists already; choose another --out", file=sys.stderr)
        return 1
    except (TaxelError, OSError) as error:
        print(f"capfingerid: {error}", file=sys.stderr)
        return 1
    (options.out / "capfingerid.json").write_text(json.dumps(result, allow_nan=False, indent=1))
    return 0 if all(row["right"] for row in result["faults"].values()) else 2


if __name__ == "__main__":
    sys.exit(main())
