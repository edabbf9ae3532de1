"""`taxel thesis`: campaigns, tables, figures, findings, diagnosis and page, in one folder."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from itertools import count
from pathlib import Path
from typing import Final

import numpy as np

from taxel.campaign.emulated import run_emulated
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.cloud.errors import CloudError
from taxel.gap.diagnosis import diagnose
from taxel.gap.page import write_page as write_gap_page
from taxel.grasp.plan import thesis_plan
from taxel.recording.grasp_dataset import GraspDataset
from taxel.thesis.figures import save_figures
from taxel.thesis.findings import Finding, findings, others
from taxel.thesis.gap_beside import Beside, beside
from taxel.thesis.matching import PARTS, ObjectClouds, ObjectResult, clouds_of, measure
from taxel.thesis.nearness import Nearness, nearness_of
from taxel.thesis.page import write_page
from taxel.thesis.printed import OBJECTS, STAGES, rows_of
from taxel.thesis.settings import DEEPER_M, EFFECTS, SCATTER, SIM_LAYER_M, SIM_SCATTER, TOUCHED, effects_on
from taxel.thesis.shapes import PARTS as SHAPE_PARTS
from taxel.thesis.shapes import shapes_told
from taxel.thesis.tables import all_tables

Show = Callable[[str, int, int], None]

SIM_SEED_STEP: Final = 1
"""The simulator's noise is not the emulated hand's."""


@dataclass(frozen=True)
class Campaign:
    """Files of both sides. made: sentences on how they were made, for the page."""

    real: Path
    sim: Path
    made: tuple[str, ...]


def make_campaign(out: Path, seed: int, jobs: int | None, show: Show) -> Campaign:
    """The 144 grasps of both sides in `out`; what is there already is gone on with. Raises TaxelError of one line."""
    plan, setup = thesis_plan(seed), Setup(placings=TOUCHED)
    effects = effects_on(board.name for board in setup.hand.boards)
    emulated = EmulatedSettings(seed=seed, effects=effects, variation=SCATTER)
    simulated = SimSettings(seed=seed + SIM_SEED_STEP, variation=SIM_SCATTER)
    real, sim = out / "real.h5", out / "sim.h5"
    run_emulated(
        real, plan, emulated, setup, jobs=jobs, resume=True, progress=lambda done, of: show("emulated hand", done, of)
    )
    thinner = replace(setup, hand=replace(setup.hand, layer_m=SIM_LAYER_M))
    run_simulated(
        sim, plan, simulated, thinner, jobs=jobs, resume=True, progress=lambda done, of: show("simulator", done, of)
    )
    made = (
        f"{len(plan)} grasps of each side, seed {seed}. The real side is the emulated hand with {'; '.join(EFFECTS)}; "
        f"its brackets lie {1e3 * DEEPER_M:.1f} mm deeper than its model has them; "
        f"objects stand {1e3 * SCATTER.object_m:.1f} mm and {np.degrees(SCATTER.object_rad):.1f} degrees from their "
        "places (standard deviation, each axis, each grasp; "
        f"{', '.join(f'{name} {factor:g} times as far' for name, factor in SCATTER.objects)}).",
        f"The simulated side is the simulator with its elastic layer, {1e3 * SIM_LAYER_M:.1f} mm thick, without any of "
        "that: objects and brackets stand where they are believed to be.",
    )
    return Campaign(real, sim, made)


def reproduce(
    campaign: Campaign, out: Path, show: Show, *, with_gap: bool = True
) -> tuple[list[Finding], Nearness, Beside | None]:
    """Tables, figures, findings and the page of a campaign. Raises TaxelError of one line."""
    with closing(GraspDataset(campaign.real)) as real, closing(GraspDataset(campaign.sim)) as sim:
        items = _clouds(real, sim, show)
    results = _results(items, show)
    tables = all_tables(results)
    (out / "tables").mkdir(parents=True, exist_ok=True)
    for table in tables:
        table.write(out / "tables" / table.file_name)
    (out / "figures").mkdir(exist_ok=True)
    figures = save_figures(items, results, out / "figures")
    besides = [*others(results), *shapes_told(items, _steps("shapes", SHAPE_PARTS * len(items), show))]
    found, near = findings(results), nearness_of(tables)
    gap = _diagnosis(campaign, out, results, show) if with_gap else None
    write_page(out / "thesis.html", tables, found, near, besides, figures, gap, campaign.made)
    summary = {
        "made": campaign.made,
        "findings": [one.to_json() for one in found],
        "distances": near.to_json(),
        "besides": [asdict(one) for one in besides],
        "objects": [one.to_json() for one in results],
        "gap": None if gap is None else asdict(gap),
    }
    (out / "thesis.json").write_text(json.dumps(summary, indent=1))
    return found, near, gap


def _clouds(real: GraspDataset, sim: GraspDataset, show: Show) -> list[ObjectClouds]:
    names = [name for name in real.objects if name in sim.objects]
    items = {}
    for done, name in enumerate(names):
        show("clouds", done, len(names))
        item = clouds_of(real, sim, name)
        items[item.thesis] = item
    show("clouds", len(names), len(names))
    missing = [word for word in OBJECTS if word not in items]
    if missing:
        expected = f"the thesis's objects ({', '.join(OBJECTS)})"
        raise CloudError(str(real.path), "objects", expected, f"no {missing[0]} one", "use a campaign of taxel grasp")
    return [items[word] for word in OBJECTS]


def _results(items: Sequence[ObjectClouds], show: Show) -> list[ObjectResult]:
    meshes = {item.thesis: item.mesh for item in items}
    step = _steps("matching", PARTS * len(items), show)
    return [measure(item, meshes, step) for item in items]


def _steps(stage: str, total: int, show: Show) -> Callable[[], None]:
    """To be called after each of a stage's steps."""
    done = count(1)
    return lambda: show(stage, next(done), total)


def _diagnosis(campaign: Campaign, out: Path, results: Sequence[ObjectResult], show: Show) -> Beside:
    """Blind to the settings: it sees the two files alone."""
    report = diagnose(campaign.real, campaign.sim, show=lambda _, done, of: show("diagnosing", done, of)).report
    (out / "gap").mkdir(exist_ok=True)
    text = json.dumps(report, allow_nan=False)
    (out / "gap" / "report.json").write_text(text)
    write_gap_page(json.loads(text), out / "gap" / "report.html")
    printed = {
        word: {row["stage"]: float(row["mean_m"]) for row in rows_of("I_10_to_12_sim_to_real", word)}
        for word in OBJECTS
    }
    return beside(report, results, {word: {stage: printed[word][stage] for stage in STAGES} for word in OBJECTS})


def given(real: Path, sim: Path) -> Campaign:
    """A campaign that somebody made."""
    return replace(Campaign(real, sim, ()), made=(f"Real side: {real.name}. Simulated side: {sim.name}.",))
