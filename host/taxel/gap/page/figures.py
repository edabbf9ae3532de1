"""The gap, its floor and how far it shrinks, in one small table."""

from __future__ import annotations

from taxel.gap.page.fields import Value
from taxel.gap.page.report import Report
from taxel.gap.page.tables import Column, Section, paragraph, table
from taxel.gap.page.text import escaped, interval, p_words, percent, plural, with_unit

_COUNTS = "counts"

Row = tuple[str, str]


def figures_section(report: Report) -> Section:
    """The section. Raises GapInputError."""
    groups = (
        ("All grasps", _gap_rows(report)),
        ("Held-out grasps", _after_rows(report)),
        ("In millimetres", _mm_rows(report)),
    )
    tables = (table((Column(title), Column("Value", "n")), rows, title, "figures") for title, rows in groups if rows)
    intro = paragraph("Below a value stands its 95&#160;% interval.") if _has_interval(report) else _no_interval()
    return Section("figures", "Figures", f'{intro}<div class="groups">{"".join(tables)}</div>')


def _has_interval(report: Report) -> bool:
    return report.gap.maybe_interval("ci95") is not None


def _no_interval() -> str:
    return paragraph("No 95&#160;% interval of the gap is given: that takes three sessions.")


def _gap_rows(report: Report) -> list[Row]:
    gap = report.gap
    verdict = "more than repeats explain" if gap.flag("significant") else "no more than repeats explain"
    rows = [
        _row(gap, "value", "Gap", _COUNTS, "root mean square difference of the mean features"),
        _row(gap, "floor", "Floor", _COUNTS, "what repeats and sessions alone cause"),
        _row(
            gap, "excess", "Excess", "counts²", f"gap² less floor²; {p_words(gap.maybe_number('p_value'))}, {verdict}"
        ),
    ]
    margin = report.root.maybe("margin")
    if margin is not None and margin.maybe_number("excess_counts2") is not None:
        words = escaped(margin.maybe_text("words")) or "an excess below this is no gap"
        rows.append(_row(margin, "excess_counts2", "Margin", "counts²", words))
    return rows


def _after_rows(report: Report) -> list[Row]:
    after = report.after
    predicted = after.maybe_number("predicted_shrink")
    said = (
        ""
        if predicted is None or not _effects(report)
        else f"; {percent(predicted)} was predicted before the held-out grasps were seen"
    )
    reducible = after.maybe_number("reducible_shrink")
    none = "not stated: the excess before is not surely positive"
    share = "of the part above the floor, as squares"
    return [
        _row(after, "before", "Before", _COUNTS, "the gap on the grasps that no fit has seen"),
        _row(after, "value", "After", _COUNTS, f"with {_added(report)} added"),
        _row(after, "floor", "Floor", _COUNTS, "of the same grasps"),
        (_label("Shrink", f"of the gap{said}"), percent(after.maybe_number("shrink"))),
        (_label("Reducible shrink", none if reducible is None else share), percent(reducible)),
        *_chosen_rows(report),
    ]


def _chosen_rows(report: Report) -> list[Row]:
    """Where the effects were searched for without each session again."""
    chosen = report.after.maybe_list("chosen_inside")
    names = set(report.verdict.texts("effects")) - {"unknown"}
    same = sum({name.as_text() for name in one.items()} == names for one in chosen)
    said = "searches without one session, judged in it, find the same effects"
    return [(_label("Chosen inside", said), f"{same} of {len(chosen)}")] if chosen else []


def _added(report: Report) -> str:
    return f"the verdict's {plural(_effects(report), 'effect')}" if _effects(report) else "nothing"


def _effects(report: Report) -> int:
    return sum(name != "unknown" for name in report.verdict.texts("effects"))


def _mm_rows(report: Report) -> list[Row]:
    mm = report.gap.maybe("mm")
    if mm is None or mm.maybe_number("value") is None:
        return []
    return [
        _row(mm, "value", "Gap", "mm", "between the clouds of active taxels"),
        _row(mm, "floor", "Floor", "mm", "between repeats of the same grasp"),
        _row(mm, "placebo", "Placebo", "mm", "as many taxels made active at random: a denser cloud alone"),
    ]


def _row(entry: Value, key: str, label: str, unit: str, words: str) -> Row:
    value = entry.field(key)
    found = None if value.content is None else value.as_number()
    bounds = entry.maybe_interval("ci95") if key == "value" else None
    below = f'<span class="says">{interval(bounds, found or 0.0)}</span>' if bounds else ""
    return _label(label, words), with_unit(found, unit) + below


def _label(label: str, words: str) -> str:
    return f'{label} <span class="says">{words}</span>'
