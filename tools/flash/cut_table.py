"""Results of a campaign: text tables, JSON, and the documentation page."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from cut_plan import MOMENTS, ROUTES
from cut_records import OPERATIONS
from cut_runs import BRICKED, CUT_AGAIN, DAMAGED, WorldResult

TEMPLATE: Final = Path(__file__).with_name("flash-power-cuts.template.md")
OUTCOMES: Final = ("old", "new", CUT_AGAIN, DAMAGED, BRICKED)
JSON_KEYS: Final = {"old": "old", "new": "new", CUT_AGAIN: "cut_again", DAMAGED: "damaged", BRICKED: "bricked"}


@dataclass
class Tally:
    """Counts of cuts by operation, phase and outcome; counts of command runs; totals of all worlds."""

    cuts: int = 0
    sequences: int = 0
    worlds: int = 0
    by_operation: dict[str, Counter[str]] = field(default_factory=lambda: {name: Counter() for name in OPERATIONS})
    by_route: dict[str, Counter[str]] = field(default_factory=lambda: {name: Counter() for name in ROUTES})
    runs: Counter[int] = field(default_factory=Counter)
    torn: int = 0
    longest_gap_s: float = 0.0
    virtual_s: float = 0.0
    failures: list[str] = field(default_factory=list)

    def add(self, result: WorldResult) -> None:
        """Add the results of one emulated world to the counts."""
        self.worlds += 1
        self.cuts += len(result.cut_records)
        self.sequences += len(result.runs)
        for record in result.cut_records:
            self.by_operation[record.operation][record.moment] += 1
            self.by_operation[record.operation][record.outcome] += 1
            self.by_route[result.route][record.outcome] += 1
        self.by_route[result.route]["sequences"] += len(result.runs)
        self.by_route[result.route]["runs"] += sum(result.runs)
        self.runs.update(result.runs)
        self.torn += result.torn
        self.longest_gap_s = max(self.longest_gap_s, result.longest_gap_s)
        self.virtual_s += result.virtual_s
        self.failures += result.failures

    def count_cuts(self, name: str) -> int:
        """Return the number of power cuts over all operations.

        name: phase of the write or outcome, such as "erasing" or "old".
        """
        return sum(counter[name] for counter in self.by_operation.values())


def build_tally(results: Iterable[WorldResult]) -> Tally:
    """Add up the counts of power cuts over all emulated worlds."""
    tally = Tally()
    for result in results:
        tally.add(result)
    return tally


def build_document(tally: Tally, seed: int) -> dict[str, Any]:
    """Build the JSON document with the counts of all power cuts."""
    return {
        "seed": seed,
        "cuts": tally.cuts,
        "updates": tally.sequences,
        "worlds": tally.worlds,
        "outcomes": {JSON_KEYS[name]: tally.count_cuts(name) for name in OUTCOMES},
        "by_operation": {
            name: {key: counter[key] for key in MOMENTS} | {JSON_KEYS[key]: counter[key] for key in OUTCOMES}
            for name, counter in tally.by_operation.items()
        },
        "by_way": {
            name: {key: counter[key] for key in ("sequences", "runs")}
            | {JSON_KEYS[key]: counter[key] for key in OUTCOMES}
            for name, counter in tally.by_route.items()
        },
        "runs_of_the_command": {str(runs): count for runs, count in sorted(tally.runs.items())},
        "torn_rows": tally.torn,
        "longest_gap_of_the_board_beside_s": round(tally.longest_gap_s, 4),
        "virtual_seconds": round(tally.virtual_s, 1),
        "failures": tally.failures,
    }


def format_operation_rows(tally: Tally) -> list[list[str]]:
    """Return the table cells of power cuts by interrupted operation: headings, one row per operation, and totals."""
    rows = [["interrupted operation", *MOMENTS, "cuts", "old", "new", CUT_AGAIN, DAMAGED, BRICKED]]
    for name, counter in tally.by_operation.items():
        cuts = sum(counter[moment] for moment in MOMENTS)
        rows.append([name, *(str(counter[key]) for key in (*MOMENTS,)), str(cuts)])
        rows[-1] += [str(counter[key]) for key in OUTCOMES]
    rows.append(["all", *(str(tally.count_cuts(key)) for key in MOMENTS), str(tally.cuts)])
    rows[-1] += [str(tally.count_cuts(key)) for key in OUTCOMES]
    return rows


def format_route_rows(tally: Tally) -> list[list[str]]:
    """Return the table cells of power cuts by route (adapter, hub, blank boards): headings, and one row per route."""
    rows = [["route", "updates", "command runs", "cuts", "old", "new", CUT_AGAIN, BRICKED]]
    for name, counter in tally.by_route.items():
        cuts = sum(counter[key] for key in OUTCOMES)
        numbers = (
            counter["sequences"],
            counter["runs"],
            cuts,
            *(counter[key] for key in ("old", "new", CUT_AGAIN, BRICKED)),
        )
        rows.append([name, *map(str, numbers)])
    return rows


def render_text(tally: Tally, seed: int) -> str:
    """Return the text with both tables of power cuts, the totals and the failures."""
    run_counts = ", ".join(f"{count} in {runs}" for runs, count in sorted(tally.runs.items()))
    lines = [*_format_columns(format_operation_rows(tally)), "", *_format_columns(format_route_rows(tally)), ""]
    lines.append(
        f"seed {seed}: {tally.cuts} cuts in {tally.sequences} updates, {tally.torn} rows torn, "
        f"{tally.count_cuts(BRICKED)} bricked, {tally.count_cuts(DAMAGED)} damaged; command runs until success: "
        f"{run_counts}"
    )
    lines.append(f"longest gap between two frames of the neighbour board: {1e3 * tally.longest_gap_s:.0f} ms")
    return "\n".join([*lines, *(f"FAILED: {failure}" for failure in tally.failures)])


def _format_columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a text table with aligned columns: the first one to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if column == 0 else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]


def render_page(tally: Tally, seed: int, command: str) -> str:
    """Return the text of docs/flash-power-cuts.md. command: command that writes the same page."""
    values = {
        "command": command,
        "seed": str(seed),
        "cuts": f"{tally.cuts:,}",
        "updates": f"{tally.sequences:,}",
        "torn": f"{tally.torn:,}",
        "bricked": str(tally.count_cuts(BRICKED)),
        "damaged": str(tally.count_cuts(DAMAGED)),
        "gap_ms": f"{1e3 * tally.longest_gap_s:.0f}",
        "hours": f"{tally.virtual_s / 3600:.1f}",
        "by_operation": _format_markdown(format_operation_rows(tally)),
        "by_route": _format_markdown(format_route_rows(tally)),
        "runs": _format_markdown(
            [["runs", "updates"], *([str(n), str(count)] for n, count in sorted(tally.runs.items()))]
        ),
    }
    text = TEMPLATE.read_text()
    for name, value in values.items():
        text = text.replace(f"{{{name}}}", value)
    return text


def _format_markdown(rows: Sequence[Sequence[str]]) -> str:
    """Return the cells as a Markdown table; the first row contains the headings."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])
