"""Run of the user's own simulator with the effects of a report."""

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
"""Name of the file format of the effects."""

VERSION: Final = 1
"""Version of the file format of the effects."""

PLACEHOLDER: Final = re.compile(r"\{(effects|sim|out)\}")
"""Placeholder of a path in a command."""

REQUIRED_PLACEHOLDERS: Final = ("{effects}", "{out}")
"""Placeholders that a command must contain. {sim} is optional, because the simulator may use its own inputs."""


def get_report_source(gap: ReportedGap) -> dict[str, str]:
    """Return path and SHA-256 of a report, for the field `report` of the effects file."""
    return {"path": str(gap.path), "sha256": gap.sha256}


def format_effects(effects: Sequence[ReportedEffect], report: Mapping[str, str] | None) -> str:
    """Return effects as JSON text, in the order in which they act from contact to count.

    An effect has name, form, scope, order and blocks; each of its parameters has a unit and one value for each block.
    report: see `get_report_source`; None for the effects of a candidate set, for which no report exists yet.
    """
    contents = [dict(effect.content) for effect in effects]
    return json.dumps({"format": FORMAT, "version": VERSION, "report": report, "effects": contents}, indent=1)


def run_simulator(command: str, effects: str, sim: Path, out: Path) -> None:
    """Run a command that writes the dataset `out`.

    command: text that is split into words as by a shell, and run without a shell; {effects}, {sim} and {out} are
    replaced by absolute paths. effects: JSON text, written to the file `effects.json` beside `out`. sim: path that
    replaces {sim}. The output of the command goes to standard error. Raises GapInputError for a command that cannot
    run, fails or writes no file.
    """
    arguments = split_command(command)
    paths = {"effects": out.with_name("effects.json"), "sim": sim, "out": out}
    paths["effects"].write_text(effects)
    arguments = [PLACEHOLDER.sub(lambda match: str(paths[match[1]].resolve()), word) for word in arguments]
    remedy = "correct the command; SIM.h5 and the report are unchanged"
    try:
        result = subprocess.run(arguments, stdin=subprocess.DEVNULL, stdout=2, check=False)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        expected = f"an executable program ({format_value(arguments[0])})"
        raise GapInputError("--resim", expected, reason, remedy) from None
    if result.returncode:
        found = f"status {result.returncode}" if result.returncode > 0 else f"an end by signal {-result.returncode}"
        raise GapInputError("--resim", f"a command that succeeds ({format_value(arguments[0])})", found, remedy)
    if not out.is_file():
        raise GapInputError("--resim", "a dataset at the path {out}", "no file", "let the command write it there")


def split_command(command: str) -> list[str]:
    """Return the words of a command.

    Raises GapInputError for open quotes, and for a command without {effects} or {out}.
    """
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise GapInputError("--resim", "a command", f"{format_value(command)} ({error})", "close the quotes") from None
    missing = [placeholder for placeholder in REQUIRED_PLACEHOLDERS if placeholder not in command]
    if not words or missing:
        expected = f"a command with {' and '.join(REQUIRED_PLACEHOLDERS)}"
        remedy = "add the paths from which it reads the effects and to which it writes the dataset"
        raise GapInputError("--resim", expected, format_value(command), remedy)
    return words
