"""What the detection campaign found, in words, as a page and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from board_faults import FAMILIES
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from detection import Result

SERIOUS: Final = 1.5
INK: Final = "#1b1d22"
COLOURS: Final = ("#1f5fa8", "#b3313e", "#3d8f5f", "#c9a227", "#7a4fa3", "#d9772b")


def _counts(results: Sequence[Result]) -> tuple[int, int, int]:
    return len(results), sum(one.caught for one in results), sum(one.named for one in results)


def _serious(results: Sequence[Result]) -> list[Result]:
    return [one for one in results if one.case.family != "healthy" and one.case.severity >= SERIOUS]


def _rows(results: Sequence[Result]) -> list[tuple[str, int, int, int, int]]:
    rows = []
    for family in FAMILIES:
        own = [one for one in _serious(results) if one.case.family == family.name]
        count, caught, named = _counts(own)
        rows.append((family.name, count, caught, named, sum(not one.others for one in own)))
    return rows


def _totals(results: Sequence[Result]) -> list[str]:
    serious = _serious(results)
    count, caught, named = _counts(serious)
    healthy = [one for one in results if one.case.family == "healthy"]
    alarms = [one for one in healthy if one.caught]
    lines = [
        f"single faults, severity 1.5 to 10: {count}, caught {caught}, named at their place {named}, "
        f"named first {sum(one.first for one in serious)}, nothing else named {sum(not one.others for one in serious)}",
        f"healthy boards: {len(healthy)}, refused {len(alarms)}",
    ]
    if results:
        automatic = sorted(one.automatic_s for one in results)
        lines.append(
            f"automatic phases: {automatic[len(automatic) // 2]:.1f} s of bench time, at most {automatic[-1]:.1f} s"
        )
    return lines


def summary(results: Sequence[Result], seed: int, seconds: float) -> str:
    """For the terminal."""
    lines = [f"seed {seed}, {len(results)} boards in {seconds:.0f} s", *_totals(results), ""]
    lines.append(f"{'fault':<28} {'boards':>6} {'caught':>6} {'named':>6} {'alone':>6}")
    lines += [
        f"{name:<28} {count:>6} {caught:>6} {named:>6} {alone:>6}"
        for name, count, caught, named, alone in _rows(results)
    ]
    for one in results:
        is_wrong = one.caught if one.case.family == "healthy" else one.case.severity >= SERIOUS and not one.named
        if is_wrong:
            case = one.case
            lines.append(
                f"WRONG {case.family} at {case.place or '-'}, {case.kind}, severity {case.severity:.2f}, world seed "
                f"{case.seed}: {'; '.join(one.others) or 'a limit is broken' if one.caught else 'passed'}"
            )
    return "\n".join(lines)


def write_page(docs: Path, results: Sequence[Result], seed: int) -> None:
    """docs/bench-faults.md and docs/images/bench-faults.png."""
    _picture(results).savefig(docs / "images" / "bench-faults.png", dpi=110, facecolor="white")
    table = "\n".join(
        f"| {name} | {count} | {caught} | {named} | {alone} |" for name, count, caught, named, alone in _rows(results)
    )
    totals = "\n".join(f"- {line}" for line in _totals(results))
    template = Path(__file__).with_name("bench-faults.template.md").read_text()
    (docs / "bench-faults.md").write_text(
        template.replace("{table}", table).replace("{totals}", totals).replace("{seed}", str(seed))
    )


def _picture(results: Sequence[Result]) -> Figure:
    """Share of boards refused, over severity, for each graded family."""
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    axes = figure.add_subplot()
    graded = [family for family in FAMILIES if family.graded]
    for place, family in enumerate(graded):
        own = [one for one in results if one.case.family == family.name]
        steps = sorted({one.case.severity for one in own if one.case.severity < SERIOUS})
        shares = [_share([one for one in own if one.case.severity == step]) for step in steps]
        serious = [one for one in own if one.case.severity >= SERIOUS]
        if serious:
            steps, shares = [*steps, 2.0], [*shares, _share(serious)]
        style = ("-", "--", ":")[place // len(COLOURS)]
        axes.plot(
            steps, shares, style, marker="o", markersize=3, color=COLOURS[place % len(COLOURS)], label=family.name
        )
    axes.axvline(1.0, color=INK, linewidth=0.8)
    axes.set_xlabel("severity: times beyond the limit (last point: all from 1.5 to 10)")
    axes.set_ylabel("share of boards refused")
    axes.set_ylim(-0.03, 1.03)
    axes.grid(True, color="#e6e8ec", linewidth=0.7)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _share(results: Sequence[Result]) -> float:
    return sum(one.caught for one in results) / max(len(results), 1)
