"""The measurements of a phase as tables: all if they are few; else a line for each name, and the rest folded."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median

from taxel.gap.page.bars import Axis
from taxel.gap.page.tables import Column, folded, paragraph, table
from taxel.gap.page.text import ABSENT, escaped, plural, words
from taxel_tools.testing.page.bars import axis_of, strip, value_bar
from taxel_tools.testing.page.elements import place_words, scrolled
from taxel_tools.testing.page.figures import allowed, figure, with_unit
from taxel_tools.testing.record import Limit, Measurement, Outcome

MOST_ROWS = 16
"""Above this the measurements that are within their limits are folded."""
MOST_FAILING = 40

_PLAIN = (Column("measurement"), Column("place"), Column("value", "n"))
_PLACE = 1
_COLUMNS = (
    *_PLAIN,
    Column("allowed", "n"),
    Column("", "pic"),
    Column("", "verdict"),
)
_SUMMARY = (
    Column("measurement"),
    Column("places", "n"),
    Column("beyond", "n"),
    Column("least", "n"),
    Column("median", "n"),
    Column("largest", "n"),
    Column("allowed", "n"),
    Column("all values", "pic"),
)


def measurements_html(title: str, measurements: Sequence[Measurement]) -> str:
    """The tables of a phase; empty if it measured nothing. title: of the phase, for people who hear the page."""
    if not measurements:
        return ""
    axes = _axes(measurements)
    caption = f"Measurements of {escaped(title)}"
    if len(measurements) <= MOST_ROWS:
        return _table(measurements, axes, caption)
    failing = sorted(
        (one for one in measurements if one.outcome is Outcome.FAIL), key=lambda one: -_severity(one.limit, one)
    )
    parts = [_summary(measurements, axes, f"{caption}, one line each")]
    if failing:
        parts.append(f"<h4>Beyond their limits ({len(failing):,})</h4>")
        parts.append(_table(failing[:MOST_FAILING], axes, f"{caption} beyond their limits"))
    if len(failing) > MOST_FAILING:
        parts.append(paragraph(f"The worst {MOST_FAILING} are shown; the others stand below.", "small"))
    whole = _table(measurements, axes, f"{caption}, all")
    return "".join(parts) + folded(f"All {plural(len(measurements), 'measurement')}", whole)


def _severity(limit: Limit | None, one: Measurement) -> float:
    return 0.0 if limit is None else limit.severity(one.value)


def _axes(measurements: Sequence[Measurement]) -> dict[tuple[str, Limit], Axis]:
    """One axis for all values of a name, so that rows compare."""
    keys = dict.fromkeys((one.name, one.limit) for one in measurements if one.limit is not None)
    return {
        (name, limit): axis_of(limit, [one.value for one in measurements if (one.name, one.limit) == (name, limit)])
        for name, limit in keys
        if limit is not None
    }


def _table(measurements: Sequence[Measurement], axes: dict[tuple[str, Limit], Axis], caption: str) -> str:
    columns: tuple[Column, ...] = _COLUMNS if axes else _PLAIN
    kept = [index for index in range(len(columns)) if index != _PLACE or any(one.place for one in measurements)]
    every = (_row(one, axes) for one in measurements)
    rows = ([row[index] for index in kept] for row in every)
    columns = tuple(columns[index] for index in kept)
    return scrolled(table(columns, rows, caption, "measured" if axes else "measured plain"), caption)


def _row(one: Measurement, axes: dict[tuple[str, Limit], Axis]) -> tuple[str, ...]:
    bar, verdict = "", ""
    if one.limit is not None:
        bar = value_bar(axes[one.name, one.limit], one.limit, one.value, one.outcome)
        verdict = f'<b class="{one.outcome}">{one.outcome}</b>'
    return (
        words(one.name),
        place_words(one.place),
        with_unit(one.value, one.unit, one.limit),
        allowed(one.limit),
        bar,
        verdict,
    )


def _summary(measurements: Sequence[Measurement], axes: dict[tuple[str, Limit], Axis], caption: str) -> str:
    groups: dict[tuple[str, str, Limit | None], list[Measurement]] = {}
    for one in measurements:
        groups.setdefault((one.name, one.unit, one.limit), []).append(one)
    rows = (_summary_row(*key, group, axes) for key, group in groups.items())
    return scrolled(table(_SUMMARY, rows, caption, "measured"), caption)


def _summary_row(
    name: str, unit: str, limit: Limit | None, group: Sequence[Measurement], axes: dict[tuple[str, Limit], Axis]
) -> tuple[str, ...]:
    failed = sum(one.outcome is Outcome.FAIL for one in group)
    values = [one.value for one in group if isinstance(one.value, int | float) and not math.isnan(one.value)]
    three = [figure(one, limit) for one in (min(values), median(values), max(values))] if values else [ABSENT] * 3
    picture = ""
    if values and (limit is not None or len(values) > 1):
        picture = strip(Axis.over(values) if limit is None else axes[name, limit], limit, values)
    return (
        words(f"{name}, {unit}" if unit.strip() else name),
        f"{len(group):,}",
        ABSENT if limit is None else f'<b class="fail">{failed:,}</b>' if failed else "0",
        *three,
        allowed(limit),
        picture,
    )
