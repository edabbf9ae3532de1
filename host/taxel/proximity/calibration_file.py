"""Calibration file: JSON, written by `taxel proximity calibrate`, and read with checks of every value."""

import json
import math
import os
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from taxel.hand import Hand
from taxel.hand.errors import format_path, format_value
from taxel.input_files import TextError, parse_json, read_regular_file
from taxel.output import write_whole
from taxel.proximity.calibration import KindCalibration, ProximityCalibration, TargetResponse
from taxel.proximity.errors import CalibrationFileError
from taxel.proximity.holds import MAX_DISTANCE_M, TARGET_NAME
from taxel.proximity.response import ResponseCurve

FORMAT: Final = "taxel-proximity-calibration"
VERSION: Final = 1
MAX_FILE_BYTES: Final = 1 << 22
MAX_POINTS: Final = 200
MAX_TARGETS: Final = 8
"""Largest number of targets of a kind: the time per frame grows in proportion."""
COUNTS_MAX: Final = 65_535.0
"""Largest absolute signal: raw counts have 16 bits."""
_TARGET_KEYS: Final = ("distance_mm", "signal_counts", "decay", "curve_error", "gain_spread", "boards")


def write_calibration(path: str | os.PathLike[str], calibration: ProximityCalibration, overwrite: bool = False) -> None:
    """Write a calibration file atomically. Raises `OutputError` if the file exists and `overwrite` is False."""
    write_whole(path, format_calibration(calibration), overwrite=overwrite)


def format_calibration(calibration: ProximityCalibration) -> str:
    """Return the text of a calibration file."""
    return json.dumps(_to_document(calibration), indent=1) + "\n"


def _to_document(calibration: ProximityCalibration) -> dict[str, Any]:
    """Return the JSON document of a calibration."""
    kinds = {}
    for name, kind in calibration.kinds.items():
        targets = {
            target: {
                "distance_mm": [round(1e3 * value, 6) for value in response.curve.distance_m.tolist()],
                "signal_counts": [round(value, 4) for value in response.curve.signal_counts.tolist()],
                "decay": round(response.curve.decay, 4),
                "curve_error": round(response.curve_error, 5),
                "gain_spread": round(response.gain_spread, 5),
                "boards": list(response.boards),
            }
            for target, response in kind.targets.items()
        }
        drift, noise = round(kind.drift_counts, 4), round(kind.noise_counts, 4)
        kinds[name] = {"noise_counts": noise, "drift_counts_per_root_s": drift, "targets": targets}
    return {"format": FORMAT, "version": VERSION, "hand": calibration.hand, "kinds": kinds}


def read_calibration(path: str | os.PathLike[str], hand: Hand) -> ProximityCalibration:
    """Read a calibration file and check that it belongs to `hand`.

    Raises `CalibrationFileError` for an invalid value, and OSError for a file that cannot be read.
    """
    reader = _Reader(format_path(os.fspath(path)))
    document = reader.load(path)
    reader.check_keys(document, ("format", "version", "hand", "kinds"))
    reader.check(document.get("format") == FORMAT, "format", f"'{FORMAT}'", document.get("format"))
    version = document.get("version")
    reader.check(type(version) is int and version == VERSION, "version", str(VERSION), version)
    reader.check(document.get("hand") == hand.name, "hand", f"'{hand.name}', the hand in use", document.get("hand"))
    known = {board.kind.name for board in hand.boards}
    kinds = {}
    for name, table in reader.table(document, "kinds").items():
        reader.check(name in known, f"kinds.{name}", f"a kind of hand '{hand.name}'", name)
        kinds[name] = _parse_kind(reader, f"kinds.{name}", table)
    reader.check(bool(kinds), "kinds", "at least one kind of board", "none")
    return ProximityCalibration(hand.name, kinds)


def _parse_kind(reader: "_Reader", field: str, table: Any) -> KindCalibration:
    """Parse the calibration of one kind of board. field: path of `table` in error messages."""
    reader.check(isinstance(table, dict), field, "a table", table)
    reader.check_keys(table, ("noise_counts", "drift_counts_per_root_s", "targets"), field)
    targets = reader.table(table, "targets", field)
    reader.check(0 < len(targets) <= MAX_TARGETS, f"{field}.targets", f"1 to {MAX_TARGETS} targets", len(targets))
    return KindCalibration(
        reader.number(table, "noise_counts", 1e-3, 1e4, field),
        reader.number(table, "drift_counts_per_root_s", 0.0, 1e4, field),
        {name: _parse_target(reader, f"{field}.targets.{name}", name, value) for name, value in targets.items()},
    )


def _parse_target(reader: "_Reader", field: str, name: str, table: Any) -> TargetResponse:
    """Parse the response to the target `name`. field: path of `table` in error messages."""
    reader.check(bool(TARGET_NAME.fullmatch(name)), field, "a name of lower-case letters, digits and _", name)
    reader.check(isinstance(table, dict), field, "a table", table)
    reader.check_keys(table, _TARGET_KEYS, field)
    distance = 1e-3 * reader.numbers(table, "distance_mm", 1e3 * MAX_DISTANCE_M, field)
    counts = reader.numbers(table, "signal_counts", COUNTS_MAX, field)
    ascending = len(distance) >= 2 and distance[0] > 0 and bool((np.diff(distance) > 0).all())
    reader.check(ascending, f"{field}.distance_mm", "at least 2 ascending numbers above 0", distance.tolist())
    reader.check(len(counts) == len(distance), f"{field}.signal_counts", f"{len(distance)} numbers", len(counts))
    decay = reader.number(table, "decay", 0.5, 10.0, field)
    curve_error, spread = (reader.number(table, key, 0.0, 1.0, field) for key in ("curve_error", "gain_spread"))
    boards = table.get("boards", [])
    is_names = isinstance(boards, list) and all(isinstance(board, str) for board in boards)
    reader.check(is_names, f"{field}.boards", "a list of names", boards)
    return TargetResponse(ResponseCurve(distance, counts, decay), curve_error, spread, tuple(boards))


class _Reader:
    """Checks of the values of one calibration file; each failure is a `CalibrationFileError`."""

    def __init__(self, file: str) -> None:
        self._file = file

    def load(self, path: str | os.PathLike[str]) -> dict[str, Any]:
        """Read and parse the file; return its JSON object."""
        try:
            document = parse_json(read_regular_file(path, MAX_FILE_BYTES), MAX_FILE_BYTES)
        except TextError as error:
            raise self._error(error.position, f"a calibration ({error.expected})", error.found) from None
        self.check(isinstance(document, dict), "file", "a JSON object", document)
        return dict(document)

    def check(self, is_valid: bool, field: str, expected: str, found: Any) -> None:
        """Raise `CalibrationFileError` unless `is_valid`. expected, found: required and actual value of the field."""
        if not is_valid:
            raise self._error(field, expected, format_value(found))

    def _error(self, field: str, expected: str, found: str) -> CalibrationFileError:
        return CalibrationFileError(self._file, field, expected, found, "calibrate again, or use the file of this skin")

    def check_keys(self, table: dict[str, Any], keys: Sequence[str], field: str = "") -> None:
        """Raise an error if `table` has a key that is not in `keys`, such as a misspelt one. field: path of the
        table.
        """
        for key in table:
            expected = f"one of the keys {', '.join(keys)}"
            self.check(key in keys, f"{field}.{format_path(key[:40])}".lstrip("."), expected, key)

    def table(self, table: dict[str, Any], key: str, field: str = "") -> dict[str, Any]:
        """Return the table `table[key]`. field: path of `table` in error messages."""
        value = table.get(key)
        self.check(isinstance(value, dict), f"{field}.{key}".lstrip("."), "a table", value)
        return dict(value or {})

    def number(self, table: dict[str, Any], key: str, low: float, high: float, field: str) -> float:
        """Return the number `table[key]`, which must lie between `low` and `high`. field: path of `table`."""
        value = table.get(key)
        is_valid = isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high
        self.check(is_valid, f"{field}.{key}", f"a number from {low:g} to {high:g}", value)
        return float(value or 0.0)

    def numbers(self, table: dict[str, Any], key: str, largest: float, field: str) -> np.ndarray[Any, np.dtype[Any]]:
        """Return the numbers `table[key]` as f64[k]: finite, with absolute values up to `largest`. field: path of
        `table`.
        """
        value = table.get(key)
        is_valid = isinstance(value, list) and 0 < len(value) <= MAX_POINTS
        is_valid = is_valid and all(
            isinstance(each, int | float)
            and not isinstance(each, bool)
            and math.isfinite(each)
            and abs(each) <= largest
            for each in value or ()
        )
        self.check(is_valid, f"{field}.{key}", f"1 to {MAX_POINTS} finite numbers up to {largest:g}", value)
        return np.array(value, dtype=np.float64)
