"""The findings of two datasets, or of a report and the datasets that it names: then no search is made again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from taxel.gap.comparison.compare import Show, ignore_progress
from taxel.gap.data.pair import Pair, read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects import catalogue
from taxel.gap.effects.catalogue import DROPOUT
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.dropped import find_dropped
from taxel.gap.errors import GapInputError
from taxel.gap.experiment_design.findings import Findings, findings_of, pairs_of, rivals_of
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import started
from taxel.gap.fitting.judge import Judge
from taxel.gap.fitting.state import State
from taxel.gap.report.checked_report import CheckedReport
from taxel.gap.report.model import block_names
from taxel.gap.report.reading import ReportedEffect, ReportedGap, read_effect, read_report, read_report_values
from taxel.gap.report.report_values import ReportValue
from taxel.gap.verdict.explanation import get_questioned
from taxel.gap.verdict.held_out import compute_held_out
from taxel.hand.errors import format_path, format_value

AGAIN = "make the report again with taxel gap diagnose"

Text = str | PathLike[str]


def findings_of_pair(real: Text, sim: Text, show: Show = ignore_progress) -> Findings:
    """Of a diagnosis that is made now. Raises DatasetError and GapInputError of one line."""
    found = diagnose(real, sim, show=show)
    verdict, links = found.verdict, found.held.links
    confounded = found.report["verdict"]["confounded_with"]
    composite, names = get_questioned(found.comparison, found.explanation, verdict.effects, verdict.rivals)
    return findings_of(found.comparison, composite, catalogue.all_effects(), names, confounded, links)


def findings_in(path: Text, show: Show = ignore_progress) -> Findings:
    """Of a report, with the datasets that it names by path and SHA-256. Raises DatasetError and GapInputError of one
    line; OSError for a report that cannot be read.
    """
    reported = read_report(path)
    report = CheckedReport(read_report_values(path))
    pair = _pair(report, reported, show)
    judge = prepared(pair)
    state = judge.state
    confounded = _confounded(report, reported)
    questioned = reported.effects or _read_first_rival(report, reported, confounded)
    composite = CompositeModel.of([_link(state, one, reported) for one in questioned if one.name != DROPOUT])
    if any(one.name == DROPOUT for one in questioned):
        composite = composite.with_link(_dropped(judge, composite))
    names = tuple(one.name for one in questioned)
    pairs = pairs_of(names, confounded)
    show("fitting", 0, 2)
    rivals = rivals_of(judge, composite, {pair: _starts(state, report, pair[1]) for pair in pairs})
    show("fitting", 1, 2)
    links = compute_held_out(judge, composite).links if names else ()
    show("fitting", 2, 2)
    return Findings(judge, composite, names, rivals, links)


def _read_first_rival(
    report: CheckedReport, reported: ReportedGap, confounded: Mapping[str, Sequence[str]]
) -> tuple[ReportedEffect, ...]:
    """The first effect that has rivals, of a report that names no effect; empty if none has."""
    name = next(iter(confounded), None)
    entry = next((one for one in report.effects if one.text("name") == name), None)
    if name is None or entry is None or entry.optional("model") is None:
        return ()
    return (read_effect(name, entry, len(reported.sensor)),)


def _pair(report: CheckedReport, reported: ReportedGap, show: Show) -> Pair:
    inputs = report.root.field("inputs")
    named = [(inputs.field(side).text("path"), inputs.field(side).text("sha256")) for side in ("real", "sim")]
    source = format_path(reported.path)
    for place, _ in named:
        if not Path(place).is_file():
            remedy = "change to the folder of the diagnosis, or give REAL.h5 and SIM.h5 instead of the report"
            raise GapInputError(f"{source}: inputs", f"the file {format_path(place)}", "none", remedy)
    pair = read_pair(named[0][0], named[1][0], lambda done, total: show("reading", done, total))
    for (place, digest), found in zip(named, pair.digests, strict=True):
        if digest != found:
            expected = f"the file from which {source} was made, SHA-256 {format_value(digest)}"
            raise GapInputError(format_path(place), expected, found, AGAIN)
    return pair


def _link(state: State, one: ReportedEffect, reported: ReportedGap) -> FittedEffect:
    pair, values = state.pair, one.values
    own = block_names(pair, one.effect.scope)[: int(one.effect.blocks_of(pair).max()) + 1]
    if list(one.blocks) != own:
        where = f"{format_path(reported.path)}: {one.name}.model.blocks"
        raise GapInputError(where, f"the blocks of {pair.paths[0]}", format_value(list(one.blocks)), AGAIN)
    if one.name == "noise":
        values = np.vstack([values[:1], np.sqrt((values[1:] ** 2).sum(axis=0))[None]])
    return FittedEffect(one.effect, values)


def _dropped(judge: Judge, composite: CompositeModel) -> FittedEffect:
    """What does not answer is found by looking, at no cost."""
    features = composite.features(judge.state)
    effect = Dropout(find_dropped(judge.state, judge.sessions, features))
    return FittedEffect(effect, effect.found_values(judge.state))


def _confounded(report: CheckedReport, reported: ReportedGap) -> Mapping[str, list[str]]:
    found = report.verdict.optional("confounded_with")
    named = {} if found is None else {name: [item.as_text() for item in own.items()] for name, own in found.entries()}
    for name in {*named, *(other for others in named.values() for other in others)}:
        if name not in catalogue.all_effects():
            where = f"{format_path(reported.path)}: verdict.confounded_with"
            raise GapInputError(where, "names of the catalogue", format_value(name), AGAIN)
    return named


def _starts(state: State, report: CheckedReport, name: str) -> list[FittedEffect]:
    """An effect in the form that the report has of it; in all forms if it has none."""
    forms = [form for form in catalogue.all_effects()[name] if not form.unavailable(state)]
    entry: ReportValue | None = next((one for one in report.effects if one.text("name") == name), None)
    model = None if entry is None else entry.optional("model")
    if model is not None:
        told = (model.optional_text("form"), model.optional_text("scope"))
        forms = [form for form in forms if (form.variant, form.scope) == told] or forms
    return [started(state, form) for form in forms]
