"""Results of the detection campaign as text, page and picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from board_faults import FAMILIES
from matplotlib.figure import Figure

from taxel.output import write_whole
from taxel.output.figure import save_figure

if TYPE_CHECKING:
    from detection import Result

SEVERITY_MIN: Final = 1.5
INK: Final = "#1b1d22"
COLOURS: Final = ("#1f5fa8", "#b3313e", "#3d8f5f", "#c9a227", "#7a4fa3", "#d9772b")


def _count_results(results: Sequence[Result]) -> tuple[int, int, int]:
    """Return the number of boards, of refused boards, and of boards whose fault is named at its place."""
    return len(results), sum(result.caught for result in results), sum(result.named for result in results)


def _select_faults(results: Sequence[Result]) -> list[Result]:
    """Select the boards with a fault of severity `SEVERITY_MIN` or more."""
    return [result for result in results if result.case.family != "healthy" and result.case.severity >= SEVERITY_MIN]


def _compute_rows(results: Sequence[Result]) -> list[tuple[str, int, int, int, int]]:
    """Compute the rows of the detection table, one per family of faults.

    Columns: family; number of faulty boards; refused boards; faults with correct name and place; boards without any
    other finding.
    """
    rows = []
    for family in FAMILIES:
        family_results = [result for result in _select_faults(results) if result.case.family == family.name]
        without_others = sum(not result.others for result in family_results)
        rows.append((family.name, *_count_results(family_results), without_others))
    return rows


def _format_totals(results: Sequence[Result]) -> list[str]:
    """Format the totals of the detection campaign, one line each.

    The lines state detected faults, refused healthy boards, and durations of the tests.
    """
    faults = _select_faults(results)
    count, caught, named = _count_results(faults)
    healthy = [result for result in results if result.case.family == "healthy"]
    alarms = [result for result in healthy if result.caught]
    without_others = sum(not result.others for result in faults)
    lines = [
        f"boards with a single fault of severity 1.5 to 10: {count}; {caught} were refused, {named} of them with the "
        f"fault named at its place, and {without_others} without the name of another fault",
        f"healthy boards: {len(healthy)}; {len(alarms)} were refused",
    ]
    if results:
        durations = sorted(result.automatic_s for result in results)
        median_s = durations[len(durations) // 2]
        lines.append(
            f"duration of the automatic phases: {median_s:.1f} s of bench time (median), at most {durations[-1]:.1f} s"
        )
    return lines


def format_summary(results: Sequence[Result], seed: int, seconds: float) -> str:
    """Format the text with the totals, the table, and one line for each wrong result.

    seconds: duration of the campaign. A result is wrong if a healthy board was refused, or if a fault of severity
    `SEVERITY_MIN` or more was not named.
    """
    lines = [f"seed {seed}, {len(results)} boards in {seconds:.0f} s", *_format_totals(results), ""]
    lines.append(f"{'fault':<28} {'boards':>6} {'caught':>6} {'named':>6} {'only':>6}")
    lines += [
        f"{name:<28} {count:>6} {caught:>6} {named:>6} {only:>6}"
        for name, count, caught, named, only in _compute_rows(results)
    ]
    for result in results:
        case = result.case
        is_wrong = result.caught if case.family == "healthy" else case.severity >= SEVERITY_MIN and not result.named
        if is_wrong:
            outcome = "; ".join(result.others) or "a limit is violated" if result.caught else "passed"
            lines.append(
                f"WRONG {case.family} at {case.place or '-'}, {case.kind}, severity {case.severity:.2f}, world seed "
                f"{case.seed}: {outcome}"
            )
    return "\n".join(lines)


def write_page(docs: Path, results: Sequence[Result], seed: int) -> None:
    """Write docs/bench-faults.md and docs/images/bench-faults.png."""
    save_figure(_draw_curves(results), docs / "images" / "bench-faults.png", dpi=110, facecolor="white")
    table = "\n".join(
        f"| {name} | {count} | {caught} | {named} | {only} |"
        for name, count, caught, named, only in _compute_rows(results)
    )
    totals = "\n".join(f"- {line}" for line in _format_totals(results))
    template = Path(__file__).with_name("bench-faults.template.md").read_text()
    write_whole(
        docs / "bench-faults.md",
        template.replace("{table}", table).replace("{totals}", totals).replace("{seed}", str(seed)),
    )


def _draw_curves(results: Sequence[Result]) -> Figure:
    """Draw the share of refused boards over the severity of their fault, one curve per family of faults."""
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    axes = figure.add_subplot()
    graded = [family for family in FAMILIES if family.is_graded]
    for i, family in enumerate(graded):
        family_results = [result for result in results if result.case.family == family.name]
        steps = sorted({result.case.severity for result in family_results if result.case.severity < SEVERITY_MIN})
        shares = [
            _compute_caught_share([result for result in family_results if result.case.severity == step])
            for step in steps
        ]
        faults = [result for result in family_results if result.case.severity >= SEVERITY_MIN]
        if faults:
            # All faults beyond `SEVERITY_MIN` are one point, which is drawn at 2.0.
            steps, shares = [*steps, 2.0], [*shares, _compute_caught_share(faults)]
        style = ("-", "--", ":")[i // len(COLOURS)]
        axes.plot(steps, shares, style, marker="o", markersize=3, color=COLOURS[i % len(COLOURS)], label=family.name)
    axes.axvline(1.0, color=INK, linewidth=0.8)
    axes.set_xlabel("severity: factor beyond the limit (last point: all from 1.5 to 10)")
    axes.set_ylabel("share of boards refused")
    axes.set_ylim(-0.03, 1.03)
    axes.grid(True, color="#e6e8ec", linewidth=0.7)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _compute_caught_share(results: Sequence[Result]) -> float:
    return sum(result.caught for result in results) / max(len(results), 1)
