"""A simulation with the effects that a diagnosis found, added frame by frame or by the user's own simulator."""

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

from taxel.gap.apply.added import with_effects
from taxel.gap.apply.draws import Chance
from taxel.gap.apply.frames import FrameStates
from taxel.gap.apply.resim import effects_text, report_source, run_simulator
from taxel.gap.apply.rewriting import Rewriting, changed, copied, made_beside
from taxel.gap.apply.same_hand import SAME_HAND, check_hand
from taxel.gap.comparison.compare import Show, ignore_progress
from taxel.gap.data.pair import PLACE_TOLERANCE_M
from taxel.gap.effects.effect import OBJECT
from taxel.gap.errors import GapInputError
from taxel.gap.report.reading import ReportedEffect, ReportedGap, read_report
from taxel.hand.errors import format_path
from taxel.input_files import open_regular_file
from taxel.recording.grasp_dataset import GraspDataset

Text = str | PathLike[str]


@dataclass(frozen=True)
class Applied:
    """What was made. effects: names of what was added, in the order in which they act. notes: for people."""

    path: Path
    effects: tuple[str, ...]
    notes: tuple[str, ...]


def apply_report(
    report: Text, sim: Text, out: Text, *, seed: int = 0, overwrite: bool = False, show: Show = ignore_progress
) -> Applied:
    """Write the simulation with the effects of the report's verdict added to its counts.

    seed: of noise, drifts and lost frames. Under no gap, or an unknown cause, it is a copy, bit for bit. Raises
    DatasetError and GapInputError of one line; a file of that name then stays as it was.
    """
    with _made(report, sim, out, overwrite) as (found, whole):
        notes = _notes(found, Path(sim), Path(out))
        if found.effects:
            copied(sim, whole)
            with threadpool_limits(limits=1):
                add_effects(found.effects, Path(sim), whole, _provenance(found, {"seed": seed}), seed, show)
    return Applied(Path(out), tuple(one.name for one in found.effects), tuple(notes))


def resimulate(report: Text, sim: Text, out: Text, command: str, *, overwrite: bool = False) -> Applied:
    """Have the user's own simulator make the simulation with the effects of the report's verdict.

    command: see `run_simulator`. Under no gap, or an unknown cause, it is not run: the result is a copy. Raises as
    `apply_report`.
    """
    with _made(report, sim, out, overwrite) as (found, whole):
        notes = _notes(found, Path(sim), Path(out))
        if found.effects:
            run_simulator(command, effects_text(found.effects, report_source(found)), Path(sim), whole)
            _check_made(found, Path(sim), whole, Path(out))
            with Rewriting(whole) as file:
                file.note(_provenance(found, {"resim": command}))
    return Applied(Path(out), tuple(one.name for one in found.effects), tuple(notes))


@contextmanager
def _made(report: Text, sim: Text, out: Text, overwrite: bool) -> Iterator[tuple[ReportedGap, Path]]:
    """The report, and where to make the dataset; a copy where nothing is to be added. What was made is checked."""
    found = read_report(report)
    inputs = Path(report), Path(sim), *([found.real] if found.real is not None else [])
    with made_beside(Path(out), inputs, overwrite) as whole:
        with GraspDataset(sim) as data:
            check_hand(found, data, format_path(sim))
        if not found.effects:
            copied(sim, whole)
        yield found, whole
        with GraspDataset(whole) as data:
            data.check()


def add_effects(
    effects: Sequence[ReportedEffect], sim: Path, target: Path, note: str, seed: int = 0, show: Show = ignore_progress
) -> None:
    """Add effects, in the order in which they act, to every frame of `target`, a copy of `sim`.

    note: provenance for the attributes of the file. seed: of noise, drifts and lost frames.
    """
    with GraspDataset(sim) as data, Rewriting(target) as copy:
        keys = [(grasp.object, grasp.approach) for grasp in data]
        conditions, repeats = {key: number for number, key in enumerate(sorted(set(keys)))}, Counter(keys)
        seen, states = dict.fromkeys(keys, 0), FrameStates(data)
        for done, (name, key) in enumerate(zip(data.ids, keys, strict=True)):
            grasp = data[name]
            chance = Chance(seed, conditions[key], seen[key], repeats[key])
            raw, valid = with_effects(states.of(grasp), grasp, effects, chance)
            seen[key] += 1
            for array, before, after in (("raw_counts", grasp.raw_counts, raw), ("valid", grasp.valid, valid)):
                if changed(before, after):
                    copy.put(name, array, after)
            show("adding effects", done + 1, len(keys))
        copy.note(note)


def _provenance(found: ReportedGap, how: Mapping[str, Any]) -> str:
    """What was added, as JSON; values of boards and taxels stand in the report, which its SHA-256 names."""
    effects = [
        {
            "name": one.name,
            "form": one.content["form"],
            "scope": one.effect.scope,
            "parameters": dict(zip(one.parameters, one.values[:, 0].tolist(), strict=True))
            if one.values.shape[1] == 1
            else list(one.parameters),
        }
        for one in found.effects
    ]
    return json.dumps(
        {"program": f"taxel {version('taxel')}", "report": report_source(found), "effects": effects, **how}
    )


def _check_made(found: ReportedGap, sim: Path, made: Path, out: Path) -> None:
    """Refuse what a simulator made where it is not of the same taxels, or holds nothing."""
    path = format_path(out)
    with GraspDataset(sim) as before, GraspDataset(made) as after:
        check_hand(found, after, path)
        apart = np.linalg.norm(before.taxels.position - after.taxels.position, axis=1)
        if apart.max() > PLACE_TOLERANCE_M:
            k = int(apart.argmax())
            expected, far = f"the position in {format_path(sim)}", f"a position {1e3 * apart[k]:.3g} mm away"
            raise GapInputError(f"{path}: /taxels/position[{k}]", expected, far, SAME_HAND)
        if not len(after):
            raise GapInputError(f"{path}: /grasps", "grasps", "none", "let the simulator write them")


def _notes(found: ReportedGap, sim: Path, out: Path) -> list[str]:
    """What a user should know of what was added, and what was not."""
    notes = []
    if not found.effects:
        why = "there is no gap" if found.status == "no_gap" else "the cause of the gap is unknown"
        return [f"{why}: no effect was added, {out} is a copy"]
    if found.remainder:
        notes.append("a part of the gap has an unknown cause, which was not added")
    with open_regular_file(sim) as file:
        if hashlib.file_digest(file, "sha256").hexdigest() != found.sim_sha256:
            notes.append("the report was made from another simulated dataset")
    with GraspDataset(sim) as data:
        objects = {grasp.object for grasp in data}
    for one in found.effects:
        left = sorted(objects - set(one.blocks)) if one.effect.scope == OBJECT else []
        if left:
            notes.append(f"{one.name}: the report has no values for {', '.join(left[:4])}; these are unchanged")
    return notes
