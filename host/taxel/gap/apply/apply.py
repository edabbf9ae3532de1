"""Simulated datasets with the effects of a report, added frame by frame or computed by the user's own simulator."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from taxel.gap.apply.frames import FrameStates
from taxel.gap.apply.grasp_effects import add_effects_to_grasp
from taxel.gap.apply.hand_check import SAME_HAND_REMEDY, check_hand
from taxel.gap.apply.random_samples import RandomStreams
from taxel.gap.apply.rewriting import DatasetEditor, copy_file, has_changed, open_temporary_output
from taxel.gap.apply.user_simulator import format_effects, get_report_source, run_simulator
from taxel.gap.comparison.compare import ProgressCallback, ignore_progress
from taxel.gap.data.pair import POSITION_TOLERANCE_M
from taxel.gap.effects.effect import OBJECT
from taxel.gap.errors import GapInputError
from taxel.gap.report.reading import ReportedEffect, ReportedGap, read_report
from taxel.hand.errors import format_path
from taxel.input_files import open_regular_file
from taxel.recording.grasp_dataset import GraspDataset

Text = str | PathLike[str]


@dataclass(frozen=True)
class AppliedReport:
    """A dataset with the effects of a report.

    Attributes:
        path: the written dataset.
        effects: names of the added effects, in the order in which they act.
        notes: remarks for the user.
    """

    path: Path
    effects: tuple[str, ...]
    notes: tuple[str, ...]


def apply_report(
    report: Text,
    sim: Text,
    out: Text,
    *,
    seed: int = 0,
    overwrite: bool = False,
    show: ProgressCallback = ignore_progress,
) -> AppliedReport:
    """Write a copy of a simulated dataset with the effects of a report's verdict added to its counts.

    report, sim: input files. out: dataset to write. seed: seed of the random numbers of noise, drift and lost frames.
    overwrite: whether `out` may replace an existing file. The result is a bit-identical copy of `sim` if the verdict is
    no gap or an unknown cause. Raises DatasetError and GapInputError with a one-line message; an existing file `out`
    then remains unchanged.
    """
    with _prepare_output(report, sim, out, overwrite) as (gap, temporary):
        notes = _describe_result(gap, Path(sim), Path(out))
        if gap.effects:
            copy_file(sim, temporary)
            with threadpool_limits(limits=1):
                add_effects(gap.effects, Path(sim), temporary, _format_provenance(gap, {"seed": seed}), seed, show)
    return AppliedReport(Path(out), tuple(effect.name for effect in gap.effects), tuple(notes))


def resimulate(report: Text, sim: Text, out: Text, command: str, *, overwrite: bool = False) -> AppliedReport:
    """Run the user's own simulator with the effects of a report's verdict, and check the dataset that it writes.

    report, sim: input files. out: dataset to write. command: command of the simulator, see `run_simulator`. If the
    verdict is no gap or an unknown cause, the command is not run, and the result is a copy of `sim`. Raises the same
    exceptions as `apply_report`.
    """
    with _prepare_output(report, sim, out, overwrite) as (gap, temporary):
        notes = _describe_result(gap, Path(sim), Path(out))
        if gap.effects:
            run_simulator(command, format_effects(gap.effects, get_report_source(gap)), Path(sim), temporary)
            _check_simulated(gap, Path(sim), temporary, Path(out))
            with DatasetEditor(temporary) as file:
                file.add_provenance(_format_provenance(gap, {"resim": command}))
    return AppliedReport(Path(out), tuple(effect.name for effect in gap.effects), tuple(notes))


@contextmanager
def _prepare_output(report: Text, sim: Text, out: Text, overwrite: bool) -> Iterator[tuple[ReportedGap, Path]]:
    """Yield the report and a temporary path for the dataset; at the end of the context, check the dataset and rename it
    to `out`.

    If the report has no effects, the dataset at the temporary path is already a copy of `sim`.
    """
    gap = read_report(report)
    inputs = Path(report), Path(sim), *([gap.real] if gap.real is not None else [])
    with open_temporary_output(Path(out), inputs, overwrite) as temporary:
        with GraspDataset(sim) as data:
            check_hand(gap, data, format_path(sim))
        if not gap.effects:
            copy_file(sim, temporary)
        yield gap, temporary
        with GraspDataset(temporary) as data:
            data.check()


def add_effects(
    effects: Sequence[ReportedEffect],
    sim: Path,
    target: Path,
    note: str,
    seed: int = 0,
    show: ProgressCallback = ignore_progress,
) -> None:
    """Add effects to every frame of `target`, a copy of `sim`.

    effects: effects in the order in which they act. note: provenance for the attributes of the file. seed: seed of the
    random numbers of noise, drift and lost frames. Raises DatasetError and GapInputError.
    """
    with GraspDataset(sim) as data, DatasetEditor(target) as copy:
        keys = [(grasp.object, grasp.approach) for grasp in data]
        conditions, repeats = {key: number for number, key in enumerate(sorted(set(keys)))}, Counter(keys)
        next_repeat, states = dict.fromkeys(keys, 0), FrameStates(data)
        for done, (name, key) in enumerate(zip(data.ids, keys, strict=True)):
            grasp = data[name]
            streams = RandomStreams(seed, conditions[key], next_repeat[key], repeats[key])
            raw, valid = add_effects_to_grasp(states.build_state(grasp), grasp, effects, streams)
            next_repeat[key] += 1
            for array, before, after in (("raw_counts", grasp.raw_counts, raw), ("valid", grasp.valid, valid)):
                if has_changed(before, after):
                    copy.replace_array(name, array, after)
            show("adding effects", done + 1, len(keys))
        copy.add_provenance(note)


def _format_provenance(gap: ReportedGap, settings: Mapping[str, Any]) -> str:
    """Return the added effects as JSON text for the attribute of the dataset.

    Values of single boards, objects or taxels are omitted; they are in the report, which is identified by its SHA-256.
    """
    effects = [
        {
            "name": effect.name,
            "form": effect.content["form"],
            "scope": effect.effect.scope,
            "parameters": dict(zip(effect.parameters, effect.values[:, 0].tolist(), strict=True))
            if effect.values.shape[1] == 1
            else list(effect.parameters),
        }
        for effect in gap.effects
    ]
    return json.dumps(
        {"program": f"taxel {version('taxel')}", "report": get_report_source(gap), "effects": effects, **settings}
    )


def _check_simulated(gap: ReportedGap, sim: Path, written: Path, out: Path) -> None:
    """Check a dataset of the user's simulator. Raises GapInputError if its taxels differ from those of `sim`, and for a
    dataset without grasps.

    written: temporary path of the dataset. out: path that the error message states.
    """
    path = format_path(out)
    with GraspDataset(sim) as before, GraspDataset(written) as after:
        check_hand(gap, after, path)
        distance = np.linalg.norm(before.taxels.position - after.taxels.position, axis=1)
        if distance.max() > POSITION_TOLERANCE_M:
            k = int(distance.argmax())
            expected, far = f"the position in {format_path(sim)}", f"a position {1e3 * distance[k]:.3g} mm away"
            raise GapInputError(f"{path}: /taxels/position[{k}]", expected, far, SAME_HAND_REMEDY)
        if not len(after):
            raise GapInputError(f"{path}: /grasps", "grasps", "none", "let the simulator write them")


def _describe_result(gap: ReportedGap, sim: Path, out: Path) -> list[str]:
    """Return remarks for the user on effects and values that were not added."""
    notes = []
    if not gap.effects:
        reason = "there is no gap" if gap.status == "no_gap" else "the cause of the gap is unknown"
        return [f"{reason}: no effect was added, {out} is a copy"]
    if gap.has_unknown_cause:
        notes.append("a part of the gap has an unknown cause, which was not added")
    with open_regular_file(sim) as file:
        if hashlib.file_digest(file, "sha256").hexdigest() != gap.sim_sha256:
            notes.append("the report was made from another simulated dataset")
    with GraspDataset(sim) as data:
        objects = {grasp.object for grasp in data}
    for effect in gap.effects:
        unchanged = sorted(objects - set(effect.blocks)) if effect.effect.scope == OBJECT else []
        if unchanged:
            notes.append(f"{effect.name}: the report has no values for {', '.join(unchanged[:4])}; these are unchanged")
    return notes
