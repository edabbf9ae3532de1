"""Export of the effects of a report to the format of a simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Final

from taxel.gap.errors import GapInputError
from taxel.gap.export.common import ExportSource, read_source
from taxel.gap.export.genesis_options import write_genesis
from taxel.gap.export.isaac_config import DEFAULT_STEP_S, write_isaac
from taxel.gap.export.mujoco_xml import DEFAULT_TIMESTEP_S, write_mjcf
from taxel.gap.export.python_module import write_python
from taxel.gap.export.translation import Translation, translate
from taxel.hand.errors import format_path, format_value
from taxel.output import write_whole

FORMATS: Final = ("mujoco", "genesis", "isaac", "python")
"""Names of the formats: simulators, and a Python module."""


@dataclass(frozen=True)
class ExportResult:
    """Result of an export.

    files: written files. effects: names of the effects that the files contain, in the order in which they act.
    approximated, not_expressed: effects that the files contain only approximately, or not at all, with the reason, by
    name of the effect. notes: remarks for the user.
    """

    files: tuple[Path, ...] = ()
    effects: tuple[str, ...] = ()
    approximated: Mapping[str, str] = field(default_factory=dict)
    not_expressed: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def export_report(
    report: str | PathLike[str],
    to: str,
    out: str | PathLike[str],
    *,
    sim: str | PathLike[str] | None = None,
    step_s: float | None = None,
    overwrite: bool = False,
) -> ExportResult:
    """Write the effects of a report for a simulator.

    to: one of FORMATS. out: file to write; for MuJoCo, the Python module with the same name and the suffix .py is
    written beside it. sim: simulated dataset; None: that of the report. step_s: time step of the simulator (MuJoCo) or
    time between two observations (Isaac Lab), seconds; None: the default of the format. Without an effect in the report
    no file is written. Raises GapInputError and DatasetError with a one-line message; existing files are then
    unchanged.
    """
    if to not in FORMATS:
        raise GapInputError("--to", f"one of {', '.join(FORMATS)}", format_value(to), "correct the name")
    source = read_source(report, sim)
    reported = source.report
    if not reported.effects:
        reason = "there is no gap" if reported.status == "no_gap" else "the cause of the gap is unknown"
        return ExportResult(notes=(f"{reason}: no effect to export, no file was written",))
    texts, translation = _build_texts(source, to, Path(out), step_s)
    _check_targets(texts, (Path(report), source.sim, reported.real), overwrite)
    for path, text in texts.items():
        _write_file(path, text)
    notes = ["a part of the gap has an unknown cause, which was not exported"] if reported.has_unknown_cause else []
    if source.missing:
        notes.append(source.missing)
    return ExportResult(
        tuple(texts), translation.expressed, translation.approximated, translation.not_expressed, tuple(notes)
    )


def _build_texts(source: ExportSource, to: str, out: Path, step_s: float | None) -> tuple[dict[Path, str], Translation]:
    """Return the contents of the files by path, and the translation of the effects, which states what it omits."""
    translation = translate(source)
    names = ", ".join(one.name for one in source.report.effects)
    note = f"Effects of the report {source.report.sha256[:12]}: {names}. Written by taxel {version('taxel')}."
    if to == "python":
        return {out: write_python(source, translation, note)}, translation
    if to == "isaac":
        text, translation = write_isaac(source, translation, step_s or DEFAULT_STEP_S, note)
        return {out: text}, translation
    if to == "genesis":
        text, translation = write_genesis(source, translation, note)
        return {out: text}, translation
    module = out.with_suffix(".py")
    if module == out:
        raise GapInputError("--out", "a file with the extension .xml", format_path(out), "choose another name")
    text, remaining = write_mjcf(source, translation, step_s or DEFAULT_TIMESTEP_S, note)
    return {out: text, module: write_python(source, remaining, note)}, translation


def _check_targets(texts: Mapping[Path, str], inputs: tuple[Path | None, ...], overwrite: bool) -> None:
    """Raise GapInputError if a file to write is a folder, is one of the inputs, or exists without `overwrite`."""
    for path in texts:
        where = format_path(path)
        if path.is_dir():
            raise GapInputError(where, "a file name", "a folder", "choose another --out")
        if path.exists() and any(one is not None and one.exists() and path.samefile(one) for one in inputs):
            raise GapInputError("--out", "a file other than the inputs", where, "choose another name")
        if path.exists() and not overwrite:
            raise GapInputError(where, "a new file", "an existing one", "choose another --out, or give --overwrite")


def _write_file(path: Path, text: str) -> None:
    """Write a file under a temporary name and then rename it. Raises GapInputError if the folder is not writable."""
    try:
        write_whole(path, text)
    except OSError as error:
        found = error.strerror or str(error)
        raise GapInputError(format_path(path), "a writable folder", found, "choose another --out") from None
