"""Run the diagnosis on measured touches: a recording against itself, and against itself without its known faults.

    python tools/gap/capfingerid.py --out DIR [--data DIR] [--splits 20] [--seed 0]

--data: a folder of CapMatrix_<name>.txt (default: the recordings in the library). DIR receives the datasets, the
reports and `capfingerid.json`. Both files of every pair are the same recording, so the results are no sim-to-real
comparison.

Conversion of recordings to grasps. The panel is one board: rows are TX, columns are RX. An object is a finger (one
recording each); an approach is one touch of the task TAP, named with the row of its centre. A finger touches a position
for about 25 frames. No position is touched twice, and means over positions differ by more than any fault of the frames.
The repeats of a grasp are therefore subsets of the frames of one touch: successive frames are grouped in blocks, and
each repeat gets one random frame of each block. A session consists of the repeats with one number. The variance between
repeats contains noise, impulses and finger motion, but not the differences between two touches; this suffices to
compare two versions of the frames.

Phases are derived from the corrected frames, since the recordings contain no commands: baseline, ten blocks without
contact before the touch; closing, the first block with contact; hold, the later blocks with contact; release, the block
from the first frame without contact. There is no recovery, because the next touch follows too soon. Frames that equal
the frame before, including the time, are omitted. The frames of a repeat have the times of their blocks.

Comparisons: (1) half of the repeats against the other half, over many random splits; (2) the measured frames against
the same frames without stale prefixes and impulses, or without one of them, and frames with prefixes only against
frames with neither.
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

from taxel.blind.measured_touches import ROW_OF_TAXEL, Frames, Repeat, list_touches, split_halves, split_repeats
from taxel.blind.touch_datasets import write_dataset
from taxel.errors import TaxelError
from taxel.gap.diagnosis import diagnose
from taxel.output import write_whole
from taxel.recording import (
    TouchRecording,
    list_recordings,
    load_recording,
)
from taxel.recording.capfingerid import COLUMNS, ROWS
from taxel.types import FloatArray

N_REPEATS: Final = 8
"""Repeats of a touch; half of them are four sessions. With three sessions the intervals are too wide for the comparison
of two halves.
"""

SIGNIFICANCE: Final = 0.05
"""Corrected p-value below which a row or phase is reported as a location of the gap."""

MAX_SHARE_ELSEWHERE: Final = 0.05
"""Largest permitted share of the excess outside the torn rows."""

SIMILAR_EFFECTS: Final = ("noise", "dropout", "latency", "baseline_drift", "hysteresis")
"""Effects similar to the faults: impulses (noise), stale taxels (dropout, latency), remaining impulses (drift)."""


@dataclass(frozen=True)
class Comparison:
    """Two versions of the same frames. has_gap: whether the diagnosis must report a gap."""

    name: str
    first: str
    second: str
    has_gap: bool


COMPARISONS: Final = (
    Comparison("both", "measured", "corrected", True),
    Comparison("stale prefixes", "measured", "without_prefixes", True),
    Comparison("impulses", "measured", "without_impulses", True),
    Comparison("prefixes without impulses", "without_impulses", "corrected", False),
)


def sample_repeats(recorded: Iterable[Frames], seed: int, max_touches: int | None = None) -> list[Repeat]:
    """Return random repeats of the touches of all recordings.

    max_touches: largest number of touches of each recording.
    """
    rng = np.random.default_rng(seed)
    repeats: list[Repeat] = []
    for frames in recorded:
        by_touch = [split_repeats(touch, N_REPEATS, rng) for touch in list_touches(frames)]
        usable = [touch_repeats for touch_repeats in by_touch if touch_repeats][:max_touches]
        repeats += [repeat for touch_repeats in usable for repeat in touch_repeats]
    return repeats


def compare_halves(folder: Path, repeats: list[Repeat]) -> dict[str, Any]:
    """Diagnose the first half of the repeats of every touch against the second half.

    There is no gap between the halves. Returns the summary of the report.
    """
    first, second = folder / "first_half.h5", folder / "second_half.h5"
    for path, half in zip((first, second), split_halves(repeats), strict=True):
        write_dataset(path, half, "measured")
    return summarise(diagnose(first, second).report)


def summarise(report: dict[str, Any]) -> dict[str, Any]:
    """Return the parts of a gap report that the result table contains."""
    rows = [line for line in report["where"]["lines"] if line["axis"] == "tx"]
    return {
        "status": report["verdict"]["status"],
        "effects": report["verdict"]["effects"],
        "one_line": report["verdict"]["one_line"],
        "gap": report["gap"]["value"],
        "floor": report["gap"]["floor"],
        "excess": report["gap"]["excess"],
        "rows": {str(line["index"]): round(line["share"], 4) for line in rows},
        "rows_found": sorted(line["index"] for line in rows if line["p_value"] < SIGNIFICANCE),
        "phases": {phase["phase"]: round(phase["share"], 4) for phase in report["where"]["phases"]},
        "phases_found": [phase["phase"] for phase in report["where"]["phases"] if phase["p_value"] < SIGNIFICANCE],
    }


def compare_versions(folder: Path, repeats: list[Repeat], comparison: Comparison) -> dict[str, Any]:
    """Diagnose two versions of the same frames, such as measured and corrected ones.

    Returns the summary, the location of the true difference, and under "right" whether the result is as expected.
    """
    for version in (comparison.first, comparison.second):
        if not (folder / f"{version}.h5").exists():
            write_dataset(folder / f"{version}.h5", repeats, version)
    report = diagnose(folder / f"{comparison.first}.h5", folder / f"{comparison.second}.h5").report
    name = comparison.name.replace(" ", "_")
    write_whole(folder / f"report_{name}.json", json.dumps(report, allow_nan=False))
    result, difference = summarise(report), locate_difference(repeats, comparison)
    share = sum(result["rows"][str(row)] for row in difference["rows"])
    rows_found = result["rows_found"]
    is_located = (
        share >= 1.0 - MAX_SHARE_ELSEWHERE
        and set(rows_found) <= set(difference["rows"])
        and difference["worst_row"] in rows_found
    )
    is_named = set(result["effects"]) <= {*SIMILAR_EFFECTS, "unknown"} and result["status"] != "no_gap"
    is_expected = is_named and is_located if comparison.has_gap else result["status"] == "no_gap"
    return {
        **result,
        "differs": difference,
        "share_on_rows": share,
        "at_place": is_located,
        "right": is_expected,
    }


def locate_difference(repeats: list[Repeat], comparison: Comparison) -> dict[str, Any]:
    """Return the location of the difference between two versions, from the frames alone.

    Contains the rows that differ, the row that differs most, and the RMS difference by row and by phase.
    """
    squares: FloatArray = np.zeros((4, ROWS))
    for phase in range(4):
        parts = []
        for frames in {repeat.touch.frames.name: repeat.touch.frames for repeat in repeats}.values():
            own = [repeat.frames[repeat.phase == phase] for repeat in repeats if repeat.touch.frames is frames]
            rows = np.concatenate(own)
            parts.append((getattr(frames, comparison.first)[rows] - getattr(frames, comparison.second)[rows]) ** 2)
        mean = np.concatenate(parts).mean(axis=0)
        squares[phase] = np.bincount(ROW_OF_TAXEL, mean, ROWS) / COLUMNS
    by_row = squares.mean(axis=0)
    names = ("baseline", "closing", "hold", "release")
    return {
        "rows": np.flatnonzero(by_row > 0).tolist(),
        "worst_row": int(by_row.argmax()),
        "rms_by_row": np.sqrt(by_row).round(2).tolist(),
        "rms_by_phase": dict(zip(names, np.sqrt(squares.mean(axis=1)).round(2).tolist(), strict=True)),
    }


def run(folder: Path, recorded: list[Frames], splits: int, seed: int, show: Callable[[str], None]) -> dict[str, Any]:
    """Run all comparisons on recordings of a touch panel.

    splits: number of random splits into repeats, with the seeds from `seed` on. show: called with one line for each
    result. Returns all results as JSON values.
    """
    repeats = sample_repeats(recorded, seed)
    touches = len(repeats) // N_REPEATS
    result: dict[str, Any] = {
        "recordings": {frames.name: frames.summarise() for frames in recorded},
        "touches": touches,
        "looks": N_REPEATS,
    }
    show(f"{touches} touches with {N_REPEATS} repeats; both files of every pair are the same recording")
    show(f"{'missing in the comparison':<32}{'gap':>7}{'floor':>7}  {'rows':<14}{'share there':>12}  verdict")
    result["faults"] = {}
    for comparison in COMPARISONS:
        row = result["faults"][comparison.name] = compare_versions(folder, repeats, comparison)
        verdict = " ".join([row["status"], *(name for name in row["effects"] if name != row["status"])])
        where = ", ".join(map(str, row["rows_found"])) or "-"
        assessment = "as expected" if row["right"] else "NOT AS EXPECTED"
        text = f"{comparison.name:<32}{row['gap']:7.1f}{row['floor']:7.1f}  {where:<14}{row['share_on_rows']:12.0%}"
        show(f"{text}  {verdict}: {assessment}")
    result["splits"] = []
    for number in range(seed, seed + splits):
        row = {"seed": number, **compare_halves(folder, sample_repeats(recorded, number))}
        result["splits"].append(row)
        show(f"split-half, seed {number:<14}{row['gap']:14.1f}{row['floor']:7.1f}{'':28}  {row['status']}")
    n_no_gap = sum(row["status"] == "no_gap" for row in result["splits"])
    result["no_gap_rate"] = n_no_gap / splits if splits else None
    show(f"split-half: no_gap in {n_no_gap} of {splits}")
    return result


def read_recordings(data: Path | None) -> list[Frames]:
    """Read the recordings of a folder of text files, or those of the library if `data` is None. Raises `TaxelError`."""
    if data is None:
        return [Frames.from_recording(load_recording(name)) for name in list_recordings()]
    importer = runpy.run_path(str(Path(__file__).resolve().parents[1] / "import_capfingerid.py"))
    paths = sorted(data.glob("CapMatrix_*.txt"))
    if not paths:
        raise TaxelError(f"{data}: expected CapMatrix_<name>.txt, found none; --data is the folder of the recordings")
    recorded = []
    for path in paths:
        try:
            recording = importer["read_recording"](path)
        except importer["FormatError"] as error:
            raise TaxelError(str(error)) from error
        time = (recording.time_ns - recording.time_ns[0]) / 1e9
        name = path.stem.removeprefix("CapMatrix_")
        recorded.append(Frames.from_recording(TouchRecording(name, time, recording.values, recording.task)))
    return recorded


def main() -> int:
    """Run the comparisons; the exit status is 1 after an error, and 2 if a result differs from the expected result."""
    parser = argparse.ArgumentParser(description="Run the diagnosis on measured touches.")
    parser.add_argument("--data", type=Path, metavar="DIR", help="folder of CapMatrix_<name>.txt")
    parser.add_argument("--out", type=Path, metavar="DIR", required=True, help="a new folder")
    parser.add_argument("--splits", type=int, default=20, metavar="N", help="random splits (20)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first split (0)")
    options = parser.parse_args()
    try:
        recorded = read_recordings(options.data)
        options.out.mkdir(parents=True)
        result = run(options.out, recorded, options.splits, options.seed, lambda line: print(line, flush=True))
    except FileExistsError:
        print(f"capfingerid: {options.out}: exists already; choose another --out", file=sys.stderr)
        return 1
    except (TaxelError, OSError) as error:
        print(f"capfingerid: {error}", file=sys.stderr)
        return 1
    write_whole(options.out / "capfingerid.json", json.dumps(result, allow_nan=False, indent=1))
    return 0 if all(fault["right"] for fault in result["faults"].values()) else 2


if __name__ == "__main__":
    sys.exit(main())
