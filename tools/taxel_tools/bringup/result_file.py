"""Result files of a bring-up: JSON for programs, and the list of the points as Markdown."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from taxel.output import write_whole
from taxel_tools.bringup.findings import Finding
from taxel_tools.bringup.measuring import Measurements

FORMAT: Final = "taxel bringup"
VERSION: Final = 1


def write_results(
    path: Path, port: str, results: Measurements, findings: Sequence[Finding], overwrite: bool = False
) -> Path:
    """Write the results as JSON to `path` and as a table to the same name with the suffix .md; return the latter.

    port: name of the port. Raises `FileExistsError` or `OutputError` with a one-line message if a file exists and
    `overwrite` is false.
    """
    document = {
        "format": FORMAT,
        "version": VERSION,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "port": port,
        "board": "" if results.watchdog_start is None else results.watchdog_start.fields.get("id", ""),
        "points": [asdict(finding) for finding in findings],
        "counts": [
            {"capacitors": capacitors, "code": code, "count": count}
            for (capacitors, code), count in sorted(results.counts.items())
        ],
        "missing": results.missing,
    }
    table = path.with_suffix(".md")
    write_whole(path, json.dumps(document, indent=2) + "\n", overwrite=overwrite)
    write_whole(table, format_table(findings), overwrite=overwrite)
    return table


def format_table(findings: Sequence[Finding]) -> str:
    """Format the findings as a Markdown page with one table row for each."""
    rows = [
        f"| {each.step} | {each.point} | {each.expected} | {each.measured} | {each.status} | {each.advice} |"
        for each in findings
    ]
    head = ["| step | point | expected | measured | result | next |", "|---|---|---|---|---|---|"]
    return "\n".join(["# Measured points of the bring-up", "", *head, *rows]) + "\n"
