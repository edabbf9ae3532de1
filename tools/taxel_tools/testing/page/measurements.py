"""Tables of the measurements of a phase: all rows if there are few, else one row for each name and folded details."""

import math
from collections.abc import Sequence
from statistics import median

from taxel.gap.page.bars import Axis
from taxel.gap.page.text import ABSENT, format_count
from taxel_tools.testing.page.bars import build_axis, render_value_bar, render_value_strip
from taxel_tools.testing.page.elements import format_place, render_scrolled
from taxel_tools.testing.page.figures import format_figure, format_limit, format_with_unit
from taxel_tools.testing.page.html_text import (
    Column,
    escape_name,
    escape_text,
    render_folded,
    render_paragraph,
    render_table,
)
from taxel_tools.testing.record import Limit, Measurement, Outcome

ROWS_MAX = 16
"""With more rows, the measurements within their limits are folded."""
FAILING_MAX = 40

_COLUMNS_WITHOUT_LIMITS = (Column("measurement"), Column("place"), Column("value", "n"))
_PLACE_COLUMN = 1
_COLUMNS_WITH_LIMITS = (
    *_COLUMNS_WITHOUT_LIMITS,
    Column("allowed", "n"),
    Column("", "pic"),
    Column("", "verdict"),
)
_SUMMARY_COLUMNS = (
    Column("measurement"),
    Column("places", "n"),
    Column("beyond", "n"),
    Column("least", "n"),
    Column("median", "n"),
    Column("largest", "n"),
    Column("allowed", "n"),
    Column("all values", "pic"),
)


def render_measurements(title: str, measurements: Sequence[Measurement]) -> str:
    """Render the HTML tables of the measurements of a phase; empty without measurements.

    title: of the phase, for screen readers.
    """
    if not measurements:
        return ""
    axes = _build_axes(measurements)
    caption = f"Measurements of {escape_text(title)}"
    if len(measurements) <= ROWS_MAX:
        return _render_table(measurements, axes, caption)
    failing = sorted(
        (measurement for measurement in measurements if measurement.outcome is Outcome.FAIL),
        key=lambda measurement: -_compute_severity(measurement.limit, measurement),
    )
    parts = [_render_summary(measurements, axes, f"{caption}, one line each")]
    if failing:
        parts.append(f"<h4>Beyond their limits ({len(failing):,})</h4>")
        parts.append(_render_table(failing[:FAILING_MAX], axes, f"{caption} beyond their limits"))
    if len(failing) > FAILING_MAX:
        parts.append(render_paragraph(f"The worst {FAILING_MAX} are shown; the full table is below.", "small"))
    full_table = _render_table(measurements, axes, f"{caption}, all")
    return "".join(parts) + render_folded(f"All {format_count(len(measurements), 'measurement')}", full_table)


def _compute_severity(limit: Limit | None, measurement: Measurement) -> float:
    """Compute the factor by which a measurement exceeds its limit; 0 without a limit."""
    return 0.0 if limit is None else limit.severity(measurement.value)


def _build_axes(measurements: Sequence[Measurement]) -> dict[tuple[str, Limit], Axis]:
    """Build one axis for all values with the same name and limit, so that the bars of the table rows are comparable."""
    keys = dict.fromkeys(
        (measurement.name, measurement.limit) for measurement in measurements if measurement.limit is not None
    )
    return {
        (name, limit): build_axis(
            limit,
            [
                measurement.value
                for measurement in measurements
                if (measurement.name, measurement.limit) == (name, limit)
            ],
        )
        for name, limit in keys
        if limit is not None
    }


def _render_table(measurements: Sequence[Measurement], axes: dict[tuple[str, Limit], Axis], caption: str) -> str:
    """Render the HTML table with one row per measurement.

    axes: axis of the bar for each (name, limit); empty: a table without limits.
    """
    columns: tuple[Column, ...] = _COLUMNS_WITH_LIMITS if axes else _COLUMNS_WITHOUT_LIMITS
    has_places = any(measurement.place for measurement in measurements)
    indices = [index for index in range(len(columns)) if index != _PLACE_COLUMN or has_places]
    full_rows = (_render_row(measurement, axes) for measurement in measurements)
    rows = ([row[index] for index in indices] for row in full_rows)
    columns = tuple(columns[index] for index in indices)
    return render_scrolled(render_table(columns, rows, caption, "measured" if axes else "measured plain"), caption)


def _render_row(measurement: Measurement, axes: dict[tuple[str, Limit], Axis]) -> tuple[str, ...]:
    """Render the HTML cells of the table row of one measurement.

    axes: axis of the bar for each (name of a measurement, limit).
    """
    bar, verdict = "", ""
    if measurement.limit is not None:
        bar = render_value_bar(
            axes[measurement.name, measurement.limit], measurement.limit, measurement.value, measurement.outcome
        )
        verdict = f'<b class="{measurement.outcome}">{measurement.outcome}</b>'
    return (
        escape_name(measurement.name),
        format_place(measurement.place),
        format_with_unit(measurement.value, measurement.unit, measurement.limit),
        format_limit(measurement.limit),
        bar,
        verdict,
    )


def _render_summary(measurements: Sequence[Measurement], axes: dict[tuple[str, Limit], Axis], caption: str) -> str:
    """Render the HTML table with one row per measured quantity; measurements of several places are combined.

    axes: axis of the bar for each (name of a measurement, limit).
    """
    groups: dict[tuple[str, str, Limit | None], list[Measurement]] = {}
    for measurement in measurements:
        groups.setdefault((measurement.name, measurement.unit, measurement.limit), []).append(measurement)
    rows = (_render_summary_row(*key, group, axes) for key, group in groups.items())
    return render_scrolled(render_table(_SUMMARY_COLUMNS, rows, caption, "measured"), caption)


def _render_summary_row(
    name: str, unit: str, limit: Limit | None, group: Sequence[Measurement], axes: dict[tuple[str, Limit], Axis]
) -> tuple[str, ...]:
    """Render the HTML cells of all measurements with one name.

    The cells state the number of places, the failures and the range of the values, and show a bar.
    """
    failed = sum(measurement.outcome is Outcome.FAIL for measurement in group)
    values = [
        measurement.value
        for measurement in group
        if isinstance(measurement.value, int | float) and not math.isnan(measurement.value)
    ]
    statistics = (min(values), median(values), max(values)) if values else ()
    statistic_texts = [format_figure(value, limit) for value in statistics] or [ABSENT] * 3
    picture = ""
    if values and (limit is not None or len(values) > 1):
        picture = render_value_strip(Axis.over(values) if limit is None else axes[name, limit], limit, values)
    return (
        escape_name(f"{name}, {unit}" if unit.strip() else name),
        f"{len(group):,}",
        ABSENT if limit is None else f'<b class="fail">{failed:,}</b>' if failed else "0",
        *statistic_texts,
        format_limit(limit),
        picture,
    )
