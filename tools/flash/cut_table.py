"""What came of all cuts: a table for people, JSON for programs, a page for the documentation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from cut_plan import MOMENTS, WAYS
from cut_records import OPERATIONS
from cut_runs import AGAIN, BRICKED, DAMAGED, WorldResult

TEMPLATE: Final = Path(__file__).with_name("flash-power-cuts.template.md")
OUTCOMES: Final = ("old", "new", AGAIN, DAMAGED, BRICKED)
KEYS: Final = {"old": "old", "new": "new", AGAIN: "cut_again", DAMAGED: "damaged", BRICKED: "bricked"}


@dataclass
class Tally:
    """Counts of cuts by what they struck, by moment and by outcome, of runs that an update took, and the rest."""

    cuts: int = 0
    sequences: int = 0
    worlds: int = 0
    by_operation: dict[str, Counter[str]] = field(default_factory=lambda: {name: Counter() for name in OPERATIONS})
    by_way: dict[str, Counter[str]] = field(default_factory=lambda: {name: Counter() for name in WAYS})
    runs: Counter[int] = field(default_factory=Counter)
    torn: int = 0
    longest_gap_s: float = 0.0
    virtual_s: float = 0.0
    failures: list[str] = field(default_factory=list)

    def add(self, result: WorldResult) -> None:
        """Take in one world."""
        self.worlds += 1
        self.cuts += len(result.struck)
        self.sequences += len(result.runs)
        for struck in result.struck:
            self.by_operation[struck.operation][struck.moment] += 1
            self.by_operation[struck.operation][struck.outcome] += 1
            self.by_way[result.way][struck.outcome] += 1
        self.by_way[result.way]["sequences"] += len(result.runs)
        self.by_way[result.way]["runs"] += sum(result.runs)
        self.runs.update(result.runs)
        self.torn += result.torn
        self.longest_gap_s = max(self.longest_gap_s, result.longest_gap_s)
        self.virtual_s += result.virtual_s
        self.failures += result.failures

    def total(self, name: str) -> int:
        """Of a moment or an outcome, over all operations."""
        return sum(counter[name] for counter in self.by_operation.values())


def tally_of(results: Iterable[WorldResult]) -> Tally:
    """All worlds together."""
    tally = Tally()
    for result in results:
        tally.add(result)
    return tally


def document_of(tally: Tally, seed: int) -> dict[str, Any]:
    """Everything as JSON."""
    return {
        "seed": seed,
        "cuts": tally.cuts,
        "updates": tally.sequences,
        "worlds": tally.worlds,
        "outcomes": {KEYS[name]: tally.total(name) for name in OUTCOMES},
        "by_operation": {
            name: {key: counter[key] for key in MOMENTS} | {KEYS[key]: counter[key] for key in OUTCOMES}
            for name, counter in tally.by_operation.items()
        },
        "by_way": {
            name: {key: counter[key] for key in ("sequences", "runs")} | {KEYS[key]: counter[key] for key in OUTCOMES}
            for name, counter in tally.by_way.items()
        },
        "runs_of_the_command": {str(runs): count for runs, count in sorted(tally.runs.items())},
        "torn_rows": tally.torn,
        "longest_gap_of_the_board_beside_s": round(tally.longest_gap_s, 4),
        "virtual_seconds": round(tally.virtual_s, 1),
        "failures": tally.failures,
    }


def rows_by_operation(tally: Tally) -> list[list[str]]:
    """Heads, a row an operation, and the sum."""
    rows = [["what was being written", *MOMENTS, "cuts", "old", "new", AGAIN, DAMAGED, BRICKED]]
    for name, counter in tally.by_operation.items():
        cuts = sum(counter[moment] for moment in MOMENTS)
        rows.append([name, *(str(counter[key]) for key in (*MOMENTS,)), str(cuts)])
        rows[-1] += [str(counter[key]) for key in OUTCOMES]
    rows.append(["all", *(str(tally.total(key)) for key in MOMENTS), str(tally.cuts)])
    rows[-1] += [str(tally.total(key)) for key in OUTCOMES]
    return rows


def rows_by_way(tally: Tally) -> list[list[str]]:
    """Heads and a row for each way in which something was written."""
    rows = [["how", "updates", "runs of the command", "cuts", "old", "new", AGAIN, BRICKED]]
    for name, counter in tally.by_way.items():
        cuts = sum(counter[key] for key in OUTCOMES)
        numbers = (
            counter["sequences"],
            counter["runs"],
            cuts,
            *(counter[key] for key in ("old", "new", AGAIN, BRICKED)),
        )
        rows.append([name, *map(str, numbers)])
    return rows


def text_of(tally: Tally, seed: int) -> str:
    """Both tables as text, and a line with the rest."""
    again = ", ".join(f"{count} in {runs}" for runs, count in sorted(tally.runs.items()))
    lines = [*_columns(rows_by_operation(tally)), "", *_columns(rows_by_way(tally)), ""]
    lines.append(
        f"seed {seed}: {tally.cuts} cuts in {tally.sequences} updates, {tally.torn} rows torn, {tally.total(BRICKED)} "
        f"bricked, {tally.total(DAMAGED)} damaged; runs of the command until it succeeded: {again}"
    )
    lines.append(f"longest gap between two frames of the board beside: {1e3 * tally.longest_gap_s:.0f} ms")
    return "\n".join([*lines, *(f"FAILED: {failure}" for failure in tally.failures)])


def _columns(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if place == 0 else cell.rjust(width)
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]


def page_of(tally: Tally, seed: int, command: str) -> str:
    """The page, from its template."""
    values = {
        "command": command,
        "seed": str(seed),
        "cuts": f"{tally.cuts:,}",
        "updates": f"{tally.sequences:,}",
        "torn": f"{tally.torn:,}",
        "bricked": str(tally.total(BRICKED)),
        "damaged": str(tally.total(DAMAGED)),
        "gap_ms": f"{1e3 * tally.longest_gap_s:.0f}",
        "hours": f"{tally.virtual_s / 3600:.1f}",
        "by_operation": _markdown(rows_by_operation(tally)),
        "by_way": _markdown(rows_by_way(tally)),
        "runs": _markdown([["runs", "updates"], *([str(n), str(count)] for n, count in sorted(tally.runs.items()))]),
    }
    text = TEMPLATE.read_text()
    for name, value in values.items():
        text = text.replace(f"{{{name}}}", value)
    return text


def _markdown(rows: Sequence[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])
