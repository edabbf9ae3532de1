"""Targets: files that the project stores itself and reads again: reports, results, histories, keys, calibrations."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from fuzz_files.array_codecs import Sqlite
from fuzz_files.document import Flat, flatten
from fuzz_files.target import COARSE, Rules, Target
from fuzz_files.text_codecs import Csv, GzipJsonLines, Json
from taxel.blind.records import read_records
from taxel.blind.run_folder import open_sealed_worlds, seal_worlds
from taxel.gap.page.document import page_text
from taxel.gap.report.reading import read_report, read_report_values
from taxel.generate.folder import open_folder
from taxel.generate.recipe_file import read_recipe
from taxel.hand import Hand, load_hand
from taxel.proximity import (
    Hold,
    KindCalibration,
    ProximityCalibration,
    TargetResponse,
    format_holds,
    read_calibration,
    read_holds,
    write_calibration,
)
from taxel.proximity.response import ResponseCurve
from taxel_tools.testing.history import History
from taxel_tools.testing.record import Finding, Limit, Measurement, Outcome, PhaseRecord, TestRecord
from taxel_tools.testing.result_file import read_json, write_json

_SEEDS: Final = Path(__file__).parent.parent / "seeds"
_DOCS: Final = Path(__file__).parents[3] / "docs"


def write_report(folder: Path) -> str:
    """Copy the stored gap report, which `taxel gap diagnose` has written."""
    (folder / "report.json").write_bytes((_SEEDS / "gap_report.json").read_bytes())
    return "report.json"


def read_report_data(path: Path) -> Flat:
    """Read the effects and taxels of a gap report."""
    return flatten(read_report(path), "", ("path", "sha256", "effect"))


def read_report_page(path: Path) -> Flat:
    """Read a gap report and return the text of its page."""
    return {"page": page_text(read_report_values(path))}


def make_record() -> TestRecord:
    """Create the record of a bench test with two phases, of which one has failed."""
    white = Measurement("white", 9.5, "counts", Limit(None, 8.0), "TX 3", Outcome.FAIL)
    name = Measurement("firmware", "0.3.1", "", None, "", Outcome.PASS)
    finding = Finding("noisy TX line", "TX 3", "lift the solder joint", 4.25)
    phases = [
        PhaseRecord("noise", "Noise", Outcome.FAIL, True, 4.5, [white], [finding], [], ["a note"], ""),
        PhaseRecord("identity", "Identity", Outcome.PASS, True, 0.5, [name], [], [], [], ""),
    ]
    return TestRecord(
        "AB-0001", "op", "bench", "boards", "1", "0" * 64, {"kind": "palm"}, "0.2", "2026-01-31T09:30:00.000Z",
        Outcome.FAIL, phases, 5.0,
    )  # fmt: skip


def write_result(folder: Path) -> str:
    """Write the result of a bench test and return the file's name."""
    write_json(make_record(), folder / "r.json")
    return "r.json"


def write_history(folder: Path) -> str:
    """Write a history with one bench test and return its name."""
    with History(folder / "h.db") as history:
        history.add(make_record())
    return "h.db"


def read_history(path: Path) -> Flat:
    """Read the earlier tests of a device, and how the present test differs from them."""
    with History(path) as history:
        return flatten({"earlier": history.list_earlier("AB-0001"), "changes": history.compare(make_record())})


def write_sealed(folder: Path) -> str:
    """Write the sealed worlds of a blind check and return the folder's name."""
    seal_worlds(folder / "check", 2, 0, seed=1)
    return "check"


def read_sealed(path: Path) -> Flat:
    """Read the sealed worlds of a blind check."""
    return flatten([world.to_json() for world in open_sealed_worlds(path)])


def write_answers(folder: Path) -> str:
    """Write the first two answers of the published blind check and return the file's name."""
    answers = GzipJsonLines().decode((_DOCS / "blind-check-answers.jsonl.gz").read_bytes())
    (folder / "a.jsonl.gz").write_bytes(GzipJsonLines().encode(answers[:2]))
    return "a.jsonl.gz"


def read_answers(path: Path) -> Flat:
    """Read the answers of a blind check."""
    return flatten(read_records(path))


def write_generated(folder: Path) -> str:
    """Write a recipe and the folder of its dataset without shards (files of the dataset)."""
    (folder / "recipe.toml").write_text("grasps = 2\nseed = 3\n")
    open_folder(folder / "out", read_recipe(folder / "recipe.toml"))
    return "."


def read_generated(path: Path) -> Flat:
    """Return the numbers of the shards that the folder of a recipe lacks."""
    return {"missing": str(open_folder(path / "out", read_recipe(path / "recipe.toml")))}


@cache
def _load_hand() -> Hand:
    """Load the hand of the calibration."""
    return load_hand("original")


def write_proximity(folder: Path) -> str:
    """Write a calibration of the response before contact and return the file's name."""
    curve = ResponseCurve(np.array([0.0005, 0.002, 0.014]), np.array([-310.5, -190.25, -9.75]), 3.5)
    targets = {"grounded": TargetResponse(curve, 0.025, 0.03125, ("palm",))}
    calibration = ProximityCalibration("original", {"palm": KindCalibration(4.125, 0.375, targets)})
    write_calibration(folder / "skin.json", calibration)
    return "skin.json"


def read_proximity(path: Path) -> Flat:
    """Read the calibrated board kinds of a proximity calibration."""
    calibration = read_calibration(path, _load_hand())
    return flatten({"hand": calibration.hand, "kinds": calibration.kinds})


def write_hold_table(folder: Path) -> str:
    """Write the table of holds (times at which a target stands still) of a calibration session; returns its name."""
    holds = [Hold(1.0, 2.5, "palm", "rest", None), Hold(3.0, 4.5, "palm", "grounded", 0.0035)]
    (folder / "holds.csv").write_text(format_holds(holds))
    return "holds.csv"


def read_hold_table(path: Path) -> Flat:
    """Read the holds (times at which a target stands still) of a calibration session."""
    return flatten(read_holds(path, _load_hand()))


_JSON: Final = ((r"\.json$", (Json(),)),)
_ALL: Final = re.compile("")
_RESULT: Final = Rules(derived=re.compile(r"#$|taxel_test_record|base64"))
_UNUSED: Final = Rules(unused=_ALL)

_REPORT_UNUSED: Final = re.compile(
    r"sha256.|^(?!taxels\.(?:sensor|tx|rx)\b|verdict\.(status|effects)|inputs\.sim\.sha256|effects\[\d+\]\.(model|parameters))"
)

_REPORT: Final = Rules(unused=_REPORT_UNUSED, derived=re.compile("^(verdict|effects)"))

_PROXIMITY: Final = Rules(derived=re.compile("#$|distance_mm"))
"""Distances are converted from millimetres to metres."""

_HOLDS: Final = Rules(derived=_ALL)
"""Rows are sorted by their time, and numbers are written in other ways than as texts."""

TARGETS: Final[tuple[Any, ...]] = (
    Target("report", write_report, _JSON, read_report_data, 0.4, _REPORT),
    Target("report-page", write_report, _JSON, read_report_page, 0.1, _UNUSED),
    Target("result", write_result, _JSON, lambda path: flatten(read_json(path)), 8.0, _RESULT),
    Target("history", write_history, ((r"\.db$", (Sqlite(),)),), read_history, 1.0, _UNUSED),
    Target("sealed-keys", write_sealed, _JSON, read_sealed, 4.0, Rules(is_protected=True)),
    Target("answers", write_answers, ((r"\.gz$", (GzipJsonLines(),)),), read_answers, 2.0, COARSE),
    Target("proximity", write_proximity, _JSON, read_proximity, 6.0, _PROXIMITY),
    Target("proximity-holds", write_hold_table, ((r"\.csv$", (Csv(),)),), read_hold_table, 6.0, _HOLDS),
    Target("generated", write_generated, _JSON, read_generated, 2.0, _UNUSED, mutable=r"\.json$"),
)
