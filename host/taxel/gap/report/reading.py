"""Checked reading of an untrusted report: the effects of its verdict with all parameter values."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import NDArray

from taxel.gap.calibration.calibration import UNKNOWN
from taxel.gap.effects import catalogue
from taxel.gap.effects.catalogue import DROPOUT
from taxel.gap.effects.dropout import Defects, Dropout, Short
from taxel.gap.effects.effect import BOARD, HAND, OBJECT, TAXEL, Effect, Parameter
from taxel.gap.errors import GapInputError
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.model import NOISE_COMPONENTS
from taxel.gap.report.report_values import REMEDY, Interval, ReportValue
from taxel.hand.errors import format_path, format_value
from taxel.input_files import InputFileError, TextError, parse_json, read_regular_file
from taxel.input_files.json_text import JSON_BYTES_MAX
from taxel.types import FloatArray

Block = int | str

MAX_NOISE_COUNTS: Final = 65_535.0
"""Largest standard deviation of noise that a report may contain, counts: the largest count of 16 bits."""

MAX_TIME_S: Final = 1e6
"""Largest time that a report may contain, seconds. Chosen: about 12 days, far above the duration of any grasp."""


@dataclass(frozen=True, eq=False)
class ReportedEffect:
    """An effect of a verdict with its parameter values.

    Attributes:
        name: name of the effect in the catalogue.
        effect: form of the effect in the catalogue.
        order: position in the order in which effects act; small values act first.
        until_s, shift_s: seconds, see `taxel.gap.report.model.describe_model`.
        blocks: names of the G blocks, as in the report.
        parameters: names of the P parameters, as in the report.
        values: f64[P, G], in the units of the parameters.
        content: the field `model` of the report, with the name of the effect.
        missing: share of lost frames by address of a board.
        stuck: indices of taxels with a constant count.
        intervals: 95 % intervals by label of the parameter, such as "spread_mm" or "seconds@32"; none below three
            sessions.
    """

    name: str
    effect: Effect
    order: int
    until_s: float
    shift_s: float
    blocks: tuple[Block, ...]
    parameters: tuple[str, ...]
    values: FloatArray
    content: Mapping[str, Any]
    missing: Mapping[int, float] = field(default_factory=dict)
    stuck: tuple[int, ...] = ()
    intervals: Mapping[str, Interval] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class ReportedGap:
    """Content of a report that is needed to add its effects to a simulation.

    Attributes:
        path, sha256: path and SHA-256 of the report file.
        status: status of the verdict.
        effects: effects of the verdict in the order in which they act; empty for the status no_gap or unknown.
        has_unknown_cause: whether the verdict names an unknown cause in addition to effects.
        sensor, tx, rx: address of the board, TX line and RX line of each taxel, [n] (n taxels).
        sim_sha256: SHA-256 of the simulated dataset of the diagnosis.
        real: path of the real dataset, or None if the report does not contain it.
    """

    path: Path
    sha256: str
    status: str
    effects: tuple[ReportedEffect, ...]
    has_unknown_cause: bool
    sensor: NDArray[np.intp]
    tx: NDArray[np.intp]
    rx: NDArray[np.intp]
    sim_sha256: str
    real: Path | None


def read_report(path: str | PathLike[str]) -> ReportedGap:
    """Read and check a report.

    Raises GapInputError with a one-line message that names file and field for invalid content, and OSError for a file
    that cannot be read.
    """
    report_path = Path(path)
    content = _read_bytes(report_path)
    try:
        return _build_reported_gap(
            report_path, _parse_report(report_path, content), hashlib.sha256(content).hexdigest()
        )
    except GapInputError as error:
        where = error.where.replace("report: ", f"{format_path(report_path)}: ", 1)
        raise GapInputError(where, error.expected, error.found, error.remedy) from None


def read_report_values(path: str | PathLike[str]) -> dict[str, Any]:
    """Return the JSON object of a report without a check of its entries. Raises GapInputError with a one-line message,
    and OSError.
    """
    report_path = Path(path)
    return _parse_report(report_path, _read_bytes(report_path))


def _read_bytes(path: Path) -> bytes:
    """Return the bytes of a report. Raises GapInputError for a path that is not a regular file, and for a too large
    file; OSError for an unreadable file.
    """
    if not path.exists() or path.is_dir():
        _fail(path, "a report.json of taxel gap diagnose", "a folder" if path.is_dir() else "no file")
    try:
        return read_regular_file(path, JSON_BYTES_MAX)
    except InputFileError:
        raise GapInputError(
            format_path(path), f"a regular file of at most {JSON_BYTES_MAX} bytes", "another", REMEDY
        ) from None


def _fail(path: Path, expected: str, found: str) -> NoReturn:
    """Raise GapInputError with the remedy to make the report again. path: file that the message names."""
    raise GapInputError(format_path(path), expected, found, REMEDY)


def _parse_report(path: Path, content: bytes) -> dict[str, Any]:
    """Return the JSON object in the text of a report. Raises GapInputError for invalid JSON, and for JSON that is not
    an object.
    """
    try:
        found = parse_json(content)
    except TextError as error:
        if content.lstrip()[:1] == b"<":
            raise GapInputError(
                format_path(path), "the report.json of a diagnosis", "an HTML page", "give the report.json beside it"
            ) from None
        where = "" if error.position == "file" else f" in {error.position}"
        _fail(path, "the report.json of a diagnosis", f"no valid JSON{where}")
    return found if isinstance(found, dict) else _fail(path, "a report in JSON", format_value(found))


def _build_reported_gap(path: Path, content: dict[str, Any], digest: str) -> ReportedGap:
    """Return the checked content of a report. content: its JSON object. digest: SHA-256 of the file. Raises
    GapInputError for a missing or malformed field.
    """
    report = CheckedReport(content)
    taxels = report.taxels
    if taxels is None:
        raise GapInputError("report: taxels", "sensor, tx and rx of each taxel", "none", REMEDY)
    sensor, tx, rx = (np.array(one, dtype=np.intp) for one in taxels)
    names = [] if report.status in ("no_gap", UNKNOWN) else report.verdict.texts("effects")
    known = [name for name in names if name != UNKNOWN]
    entries = {entry.text("name"): entry for entry in report.effects}
    effects = []
    for index, name in enumerate(known):
        if name not in catalogue.all_effects() or known.index(name) != index:
            raise GapInputError(
                f"report: verdict.effects[{index}]", "names of the catalogue", format_value(name), REMEDY
            )
        if name not in entries:
            raise GapInputError("report: effects", f"an entry for {name}, which the verdict names", "none", REMEDY)
        effects.append(read_effect(name, entries[name], len(sensor)))
    return ReportedGap(
        path,
        digest,
        report.status,
        tuple(sorted(effects, key=lambda one: one.order)),
        UNKNOWN in names,
        sensor,
        tx,
        rx,
        report.root.field("inputs").field("sim").text("sha256"),
        Path(hand.text("path")) if (hand := report.root.field("inputs").optional("real")) is not None else None,
    )


def convert_fitted_effect(fitted_effect: FittedEffect, model: Mapping[str, Any]) -> ReportedEffect:
    """Convert a fitted effect into an effect of a report, without a file.

    model: field `model` of the effect, see `taxel.gap.report.model.describe_model`.
    """
    missing = model.get("missing", {"blocks": (), "values": ()})
    parameters = model["parameters"]
    return ReportedEffect(
        name=fitted_effect.effect.name,
        effect=fitted_effect.effect,
        order=model["order"],
        until_s=model["until_s"],
        shift_s=model["shift_s"],
        blocks=tuple(model["blocks"]),
        parameters=tuple(parameters),
        values=np.array([one["values"] for one in parameters.values()], np.float64).reshape(len(parameters), -1),
        content={**model, "name": fitted_effect.effect.name},
        missing=dict(zip(missing["blocks"], missing["values"], strict=True)),
        stuck=tuple(model.get("stuck", ())),
    )


def read_effect(name: str, entry: ReportValue, taxels: int) -> ReportedEffect:
    """Return an effect with its fitted values, read from its entry in the field `effects` of a report.

    name: name of the effect. taxels: number of taxels of the report. Raises GapInputError for a missing or malformed
    field.
    """
    model = entry.field("model")
    form, scope = model.text("form"), model.text("scope")
    blocks = _read_blocks(model, scope, taxels)
    missing: dict[int, float] = {}
    stuck: tuple[int, ...] = ()
    if name == DROPOUT:
        shorts = tuple(_read_short(one) for one in model.optional_list("shorts"))
        effect: Effect = Dropout(Defects(np.zeros(0, bool), (), np.zeros(0), shorts=shorts))
        missing, stuck = _read_missing_shares(model.field("missing")), tuple(model.integers("stuck", 0, taxels - 1))
    else:
        effect = _find_form(name, form, scope, model)
    if scope != effect.scope:
        model.field("scope").reject(effect.scope)
    parameters = effect.parameters()
    if name == "noise":
        parameters = tuple(Parameter(part, "counts", 0.0, MAX_NOISE_COUNTS, 0.0, 0.0) for part in NOISE_COMPONENTS)
    return ReportedEffect(
        name,
        effect,
        model.field("order").as_integer(0, 1000),
        _read_number(model.field("until_s"), 1e-6, MAX_TIME_S),
        _read_number(model.field("shift_s"), -MAX_TIME_S, MAX_TIME_S),
        blocks,
        tuple(parameter.name for parameter in parameters),
        _read_values(model.field("parameters"), parameters, len(blocks)),
        {**model.table(), "name": name},
        missing,
        stuck,
        _read_intervals(entry.optional("parameters")),
    )


def _read_intervals(parameters: ReportValue | None) -> dict[str, Interval]:
    """Return the 95 % intervals by label; parameters without an interval are omitted. parameters: field of the entry,
    or None.
    """
    entries = parameters.entries() if parameters else ()
    found = {label: one.optional_interval("ci95") for label, one in entries}
    return {label: bounds for label, bounds in found.items() if bounds is not None}


def _find_form(name: str, form: str, scope: str, model: ReportValue) -> Effect:
    """Return the variant of an effect (form) that the catalogue contains under these names.

    name: name of the effect. form: name of the variant. scope: kind of the parts with values of their own, such as
    "board". model: field of the report, for the message. Raises GapInputError for an unknown form.
    """
    forms = catalogue.all_effects()[name]
    found = next((one for one in forms if (one.variant, one.scope) == (form, scope)), None)
    if found is None:
        known = ", ".join(f"{one.variant or 'plain'} of the {one.scope}" for one in forms)
        where, remedy = f"report: {model.path}.form", "use the version of taxel that made the report"
        raise GapInputError(
            where, f"a form of {name} ({known})", f"{format_value(form)} of {format_value(scope)}", remedy
        )
    return found


def _read_blocks(model: ReportValue, scope: str, taxels: int) -> tuple[Block, ...]:
    """Return the names of the blocks of an effect: the parts of the hand, or the objects, with values of their own.

    model: field of the report. scope: kind of the blocks (hand, board, object or taxel). taxels: number of taxels.
    Raises GapInputError for other blocks than the scope permits.
    """
    found = model.field("blocks")
    items = found.items()
    if scope == HAND and [item.content for item in items] == [HAND]:
        return (HAND,)
    if scope == TAXEL and [item.content for item in items] == list(range(taxels)):
        return tuple(range(taxels))
    if scope == BOARD:
        blocks: list[Block] = [item.as_integer(0, 255) for item in items]
    elif scope == OBJECT:
        blocks = [item.as_text() for item in items]
    else:
        found.reject(
            {HAND: f"[{HAND!r}]", TAXEL: f"the indices 0 to {taxels - 1}"}.get(scope, "blocks of a known scope")
        )
    if not blocks or len(set(blocks)) != len(blocks):
        found.reject("each board or object once")
    return tuple(blocks)


def _read_values(found: ReportValue, parameters: tuple[Parameter, ...], blocks: int) -> FloatArray:
    """Return the values f64[P, G] (P parameters) of all parameters. Raises GapInputError unless each has the unit and
    the range of the form.

    found: field `parameters` of the model. blocks: number G of blocks.
    """
    wanted = [parameter.name for parameter in parameters]
    if sorted(found.table()) != sorted(wanted):
        found.reject(f"{', '.join(wanted)} and nothing else")
    rows = []
    for parameter in parameters:
        entry = found.field(parameter.name)
        if entry.text("unit") != parameter.unit:
            entry.field("unit").reject(parameter.unit)
        items = entry.field("values").items()
        if len(items) != blocks:
            raise GapInputError(f"report: {entry.path}.values", f"{blocks} numbers", str(len(items)), REMEDY)
        rows.append([_read_number(item, parameter.low, parameter.high) for item in items])
    return np.array(rows, dtype=np.float64).reshape(len(parameters), blocks)


def _read_missing_shares(found: ReportValue) -> dict[int, float]:
    """Return the share of lost frames by board address. Raises GapInputError for a malformed field."""
    boards = _read_blocks(found, BOARD, 0)
    shares = [_read_number(item, 0.0, 1.0) for item in found.field("values").items()]
    if len(shares) != len(boards):
        raise GapInputError(f"report: {found.path}.values", f"{len(boards)} numbers", str(len(shares)), REMEDY)
    return {int(board): share for board, share in zip(boards, shares, strict=True)}


def _read_short(found: ReportValue) -> Short:
    """Return two shorted lines from a list of address, axis, index of the first line, and share of the summed signal.
    Raises GapInputError for a malformed list.
    """
    items = found.items()
    if len(items) != 4 or items[1].content not in ("tx", "rx"):
        found.reject('an address, "tx" or "rx", an index and a share')
    share = _read_number(items[3], 0.0, 2.0)
    return Short(items[0].as_integer(0, 255), items[1].as_text(), items[2].as_integer(0, 255), share)


def _read_number(found: ReportValue, low: float, high: float) -> float:
    """Return a number from `low` to `high`. Raises GapInputError for any other value."""
    number = found.as_number()
    if not low <= number <= high:
        found.reject(f"a number from {low:g} to {high:g}")
    return number
