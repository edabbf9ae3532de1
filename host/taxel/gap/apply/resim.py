"""The user's own simulator, run once more with the effects that a diagnosis found."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from taxel.gap.errors import GapInputError
from taxel.gap.report.reading import ReportedEffect, ReportedGap
from taxel.hand.errors import format_value

FORMAT: Final = "taxel-gap-effects"
VERSION: Final = 1

PLACE: Final = re.compile(r"\{(effects|sim|out)\}")
NEEDED: Final = ("{effects}", "{out}")


def report_source(found: ReportedGap) -> dict[str, str]:
    """Path and SHA-256 of a report, as written beside its effects."""
    return {"path": str(found.path), "sha256": found.sha256}


def effects_text(effects: Sequence[ReportedEffect], report: Mapping[str, str] | None) -> str:
    """Effects as JSON, in the order in which they act from contact to count.

    Of each: name, form, scope, order, blocks, and of each parameter its unit and one value for each block. report: see
    `report_source`; None: the effects of a candidate set, of which no report exists yet.
    """
    contents = [dict(one.content) for one in effects]
    return json.dumps({"format": FORMAT, "version": VERSION, "report": report, "effects": contents}, indent=1)


def run_simulator(command: str, effects: str, sim: Path, out: Path) -> None:
    """Run a command that makes `out`. effects: JSON, written into a file beside it.

    command: split as a shell splits words, and run without one; {effects}, {sim} and {out} become absolute paths. What
    it prints goes to standard error. Raises GapInputError for a command that cannot run, fails or makes no file.
    """
    arguments = split_command(command)
    places = {"effects": out.with_name("effects.json"), "sim": sim, "out": out}
    places["effects"].write_text(effects)
    arguments = [PLACE.sub(lambda found: str(places[found[1]].resolve()), word) for word in arguments]
    remedy = "correct the command; SIM.h5 and the report are unchanged"
    try:
        done = subprocess.run(arguments, stdin=subprocess.DEVNULL, stdout=2, check=False)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        expected = f"an executable program ({format_value(arguments[0])})"
        raise GapInputError("--resim", expected, reason, remedy) from None
    if done.returncode:
        found = f"status {done.returncode}" if done.returncode > 0 else f"an end by signal {-done.returncode}"
        raise GapInputError("--resim", f"a command that succeeds ({format_value(arguments[0])})", found, remedy)
    if not out.is_file():
        raise GapInputError("--resim", "a dataset at the path {out}", "no file", "let the command write it there")


def split_command(command: str) -> list[str]:
    """Words of a command with {effects} and {out}. Raises GapInputError."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise GapInputError("--resim", "a command", f"{format_value(command)} ({error})", "close the quotes") from None
    missing = [place for place in NEEDED if place not in command]
    if not words or missing:
        expected = f"a command with {' and '.join(NEEDED)}"
        remedy = "add the paths from which it reads the effects and to which it writes the dataset"
        raise GapInputError("--resim", expected, format_value(command), remedy)
    return words
