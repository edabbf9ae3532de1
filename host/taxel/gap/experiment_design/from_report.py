"""Findings of a new diagnosis of two datasets, or of an existing report without a repetition of the search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from taxel.gap.comparison.compare import ProgressCallback, ignore_progress
from taxel.gap.data.pair import Pair, read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects import catalogue
from taxel.gap.effects.catalogue import DROPOUT
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.dropout_inspection import find_defects
from taxel.gap.errors import GapInputError
from taxel.gap.experiment_design.findings import Findings, collect_findings, fit_rivals, rank_pairs
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import start_effect
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.fitting.state import State
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.model import list_block_names
from taxel.gap.report.reading import ReportedEffect, ReportedGap, read_effect, read_report, read_report_values
from taxel.gap.report.report_values import ReportValue
from taxel.gap.verdict.explanation import get_leading_composite
from taxel.gap.verdict.held_out import compute_held_out
from taxel.hand.errors import format_path, format_value

REPEAT_REMEDY = "make the report again with taxel gap diagnose"
"""Remedy of error messages: the report does not belong to the datasets or to the catalogue."""

Text = str | PathLike[str]


def diagnose_findings(real: Text, sim: Text, show: ProgressCallback = ignore_progress) -> Findings:
    """Diagnose two datasets and return the findings.

    real, sim: paths of the datasets. show: callback for progress. Raises DatasetError and GapInputError with a one-line
    message.
    """
    diagnosis = diagnose(real, sim, show=show)
    verdict, replicates = diagnosis.verdict, diagnosis.held_out.fitted_effects
    confounded = diagnosis.report["verdict"]["confounded_with"]
    composite, names = get_leading_composite(
        diagnosis.comparison, diagnosis.explanation, verdict.effects, verdict.rivals
    )
    return collect_findings(diagnosis.comparison, composite, catalogue.all_effects(), names, confounded, replicates)


def read_findings(path: Text, show: ProgressCallback = ignore_progress) -> Findings:
    """Return the findings of a report. The two datasets are read from the paths in the report, and checked by SHA-256.

    Raises DatasetError and GapInputError with a one-line message; OSError for a report that cannot be read.
    """
    reported = read_report(path)
    report = CheckedReport(read_report_values(path))
    pair = _read_datasets(report, reported, show)
    fit_data = prepare_pair(pair)
    state = fit_data.state
    confounded = _read_confounded(report, reported)
    effects = reported.effects or _read_first_rival(report, reported, confounded)
    composite = CompositeModel.from_effects(
        [_read_fitted_effect(state, effect, reported) for effect in effects if effect.name != DROPOUT]
    )
    if any(effect.name == DROPOUT for effect in effects):
        composite = composite.with_effect(_find_dropout(fit_data, composite))
    names = tuple(effect.name for effect in effects)
    pairs = rank_pairs(names, confounded)
    show("fitting", 0, 2)
    rivals = fit_rivals(fit_data, composite, {pair: _read_starts(state, report, pair[1]) for pair in pairs})
    show("fitting", 1, 2)
    replicates = compute_held_out(fit_data, composite).fitted_effects if names else ()
    show("fitting", 2, 2)
    return Findings(fit_data, composite, names, rivals, replicates)


def _read_first_rival(
    report: CheckedReport, reported: ReportedGap, confounded: Mapping[str, Sequence[str]]
) -> tuple[ReportedEffect, ...]:
    """Return the first effect in `confounded` as a tuple of length 1, to be used if the report names no effect.

    confounded: for each effect of the report that is confounded with others, the names of these others. The tuple is
    empty if `confounded` is empty, or if the report does not contain the fitted model of the first effect.
    """
    name = next(iter(confounded), None)
    entry = next((effect for effect in report.effects if effect.text("name") == name), None)
    if name is None or entry is None or entry.optional("model") is None:
        return ()
    return (read_effect(name, entry, len(reported.sensor)),)


def _read_datasets(report: CheckedReport, reported: ReportedGap, show: ProgressCallback) -> Pair:
    """Read the two datasets that a report names. Raises GapInputError for a missing or changed file."""
    inputs = report.root.field("inputs")
    named = [(inputs.field(side).text("path"), inputs.field(side).text("sha256")) for side in ("real", "sim")]
    source = format_path(reported.path)
    for path, _ in named:
        if not Path(path).is_file():
            remedy = "change to the folder of the diagnosis, or give REAL.h5 and SIM.h5 instead of the report"
            raise GapInputError(f"{source}: inputs", f"the file {format_path(path)}", "none", remedy)
    pair = read_pair(named[0][0], named[1][0], lambda done, total: show("reading", done, total))
    for (path, expected_digest), digest in zip(named, pair.digests, strict=True):
        if expected_digest != digest:
            expected = f"the file from which {source} was made, SHA-256 {format_value(expected_digest)}"
            raise GapInputError(format_path(path), expected, digest, REPEAT_REMEDY)
    return pair


def _read_fitted_effect(state: State, entry: ReportedEffect, reported: ReportedGap) -> FittedEffect:
    """Return an effect of a report as a fitted effect. Raises GapInputError if its blocks are not those of the state.

    The report divides common noise into three components; the fitted effect has their root sum of squares.
    """
    pair, values = state.pair, entry.values
    blocks = list_block_names(pair, entry.effect.scope)[: int(entry.effect.find_blocks_of_pair(pair).max()) + 1]
    if list(entry.blocks) != blocks:
        where = f"{format_path(reported.path)}: {entry.name}.model.blocks"
        raise GapInputError(where, f"the blocks of {pair.paths[0]}", format_value(list(entry.blocks)), REPEAT_REMEDY)
    if entry.name == "noise":
        values = np.vstack([values[:1], np.sqrt((values[1:] ** 2).sum(axis=0))[None]])
    return FittedEffect(entry.effect, values)


def _find_dropout(fit_data: FitData, composite: CompositeModel) -> FittedEffect:
    """Return the dropout, which is found by inspection of the signals, not by a fit."""
    features = composite.predict_features(fit_data.state)
    effect = Dropout(find_defects(fit_data.state, fit_data.sessions, features))
    return FittedEffect(effect, effect.make_detected_values(fit_data.state))


def _read_confounded(report: CheckedReport, reported: ReportedGap) -> Mapping[str, list[str]]:
    """Return the confounded effects of a report by name. Raises GapInputError for a name outside the catalogue."""
    entry = report.verdict.optional("confounded_with")
    confounded = (
        {} if entry is None else {name: [item.as_text() for item in rivals.items()] for name, rivals in entry.entries()}
    )
    for name in {*confounded, *(rival for rivals in confounded.values() for rival in rivals)}:
        if name not in catalogue.all_effects():
            where = f"{format_path(reported.path)}: verdict.confounded_with"
            raise GapInputError(where, "names of the catalogue", format_value(name), REPEAT_REMEDY)
    return confounded


def _read_starts(state: State, report: CheckedReport, name: str) -> list[FittedEffect]:
    """Return an effect with start values: in the form that the report states, otherwise in all available forms.

    The form is unknown if the report has no model of the effect, or if the stated form is not available.
    """
    forms = [form for form in catalogue.all_effects()[name] if not form.find_unavailable_reason(state)]
    entry: ReportValue | None = next((effect for effect in report.effects if effect.text("name") == name), None)
    model = None if entry is None else entry.optional("model")
    if model is not None:
        reported_form = (model.optional_text("form"), model.optional_text("scope"))
        forms = [form for form in forms if (form.variant, form.scope) == reported_form] or forms
    return [start_effect(state, form) for form in forms]
