"""The reproduction of chapter 5 in one folder: campaigns, tables, figures, findings, diagnosis and page."""

import json
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
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
from taxel.grasp.plan import make_thesis_plan
from taxel.recording.grasp_dataset import GraspDataset
from taxel.thesis.distance_agreement import DistanceAgreement, compare_distances
from taxel.thesis.figures import save_figures
from taxel.thesis.findings import Finding, compute_further_results, evaluate_findings
from taxel.thesis.gap_summary import GapSummary, summarise_gap
from taxel.thesis.matching import STEPS, ObjectClouds, ObjectResult, accumulate_clouds, measure
from taxel.thesis.page import PageContent, write_page
from taxel.thesis.printed import OBJECTS, STAGES, select_rows
from taxel.thesis.settings import (
    EFFECTS,
    OBJECT_VARIATION,
    SIM_LAYER_M,
    SIM_VARIATION,
)
from taxel.thesis.shape_matching import STEPS as SHAPE_STEPS
from taxel.thesis.shape_matching import count_identified_shapes
from taxel.thesis.tables import build_tables

ShowStage = Callable[[str, int, int], None]
"""Called with the name of a stage, the finished steps of the stage and the number of all its steps."""

SIM_SEED_STEP: Final = 1
"""Difference between the seeds of the simulator and of the emulated hand, so that their noise differs."""


@dataclass(frozen=True)
class Campaign:
    """The real and the simulated dataset of a reproduction.

    description: sentences for the page on how they were made.
    """

    real: Path
    sim: Path
    description: tuple[str, ...]


def make_campaign(out: Path, seed: int, jobs: int | None, show: ShowStage) -> Campaign:
    """Run the 144 grasps of the thesis on the emulated hand and in the simulator, and store them in the folder `out`.

    An interrupted campaign in the folder is continued. jobs: number of processes. show: called with the progress.
    Raises TaxelError.
    """
    plan, setup = make_thesis_plan(seed), Setup(setting="hardware")
    emulated = EmulatedSettings(seed=seed, effects=EFFECTS, variation=OBJECT_VARIATION)
    simulated = SimSettings(seed=seed + SIM_SEED_STEP, variation=SIM_VARIATION)
    real, sim = out / "real.h5", out / "sim.h5"
    run_emulated(
        real,
        plan,
        emulated,
        setup,
        jobs=jobs,
        resume=True,
        progress=lambda done, total: show("emulated hand", done, total),
    )
    sim_setup = Setup(replace(setup.hand, layer_m=SIM_LAYER_M), setting="simulation")
    run_simulated(
        sim,
        plan,
        simulated,
        sim_setup,
        jobs=jobs,
        resume=True,
        progress=lambda done, total: show("simulator", done, total),
    )
    description = (
        f"{len(plan)} grasps on each side, seed {seed}. The real side is the emulated hand with {'; '.join(EFFECTS)}. "
        "Tool poses and torques are those of the original hardware. The object pose "
        f"varies by {1e3 * OBJECT_VARIATION.object_m:.1f} mm and {np.degrees(OBJECT_VARIATION.object_rad):.1f} degrees "
        "(standard deviation of each axis in each grasp).",
        f"The simulated side is the simulator with an elastic layer of {1e3 * SIM_LAYER_M:.1f} mm, without these "
        "effects, with the tool poses and torques of the original simulation.",
    )
    return Campaign(real, sim, description)


def reproduce(
    campaign: Campaign, out: Path, show: ShowStage, *, with_gap: bool = True
) -> tuple[list[Finding], DistanceAgreement, GapSummary | None]:
    """Write tables, figures, findings and the page of a campaign to the folder `out`. Raises TaxelError."""
    with closing(GraspDataset(campaign.real)) as real, closing(GraspDataset(campaign.sim)) as sim:
        items = _accumulate_objects(real, sim, show)
    results = _measure_objects(items, show)
    tables = build_tables(results)
    (out / "tables").mkdir(parents=True, exist_ok=True)
    for table in tables:
        table.write(out / "tables" / table.file_name)
    (out / "figures").mkdir(exist_ok=True)
    figures = save_figures(items, results, out / "figures")
    shapes = count_identified_shapes(items, _step_counter("shapes", SHAPE_STEPS * len(items), show))
    further_results = [*compute_further_results(results), *shapes]
    findings, agreement = evaluate_findings(results), compare_distances(tables)
    gap = _diagnose(campaign, out, results, show) if with_gap else None
    content = PageContent(tables, findings, agreement, further_results, figures, gap, campaign.description)
    write_page(out / "thesis.html", content)
    summary = {
        "made": campaign.description,
        "findings": [finding.to_json() for finding in findings],
        "distances": agreement.to_json(),
        "besides": [result.to_json() for result in further_results],
        "objects": [result.to_json() for result in results],
        "gap": None if gap is None else gap.to_json(),
    }
    (out / "thesis.json").write_text(json.dumps(summary, indent=1))
    return findings, agreement, gap


def use_existing_campaign(real: Path, sim: Path) -> Campaign:
    """Return a campaign that consists of two existing datasets, real and simulated."""
    return Campaign(real, sim, (f"Real side: {real.name}. Simulated side: {sim.name}.",))


def _accumulate_objects(real: GraspDataset, sim: GraspDataset, show: ShowStage) -> list[ObjectClouds]:
    """Accumulate and treat the clouds of the objects of the thesis, in its order.

    Raises CloudError for a missing object.
    """
    names = [name for name in real.objects if name in sim.objects]
    items = {}
    for done, name in enumerate(names):
        show("clouds", done, len(names))
        item = accumulate_clouds(real, sim, name)
        items[item.printed_name] = item
    show("clouds", len(names), len(names))
    missing = [name for name in OBJECTS if name not in items]
    if missing:
        expected = f"the objects of the thesis ({', '.join(OBJECTS)})"
        raise CloudError(str(real.path), "objects", expected, f"no {missing[0]} one", "use a campaign of taxel grasp")
    return [items[name] for name in OBJECTS]


def _measure_objects(items: Sequence[ObjectClouds], show: ShowStage) -> list[ObjectResult]:
    """Measure the distances of all clouds of each object."""
    meshes = {item.printed_name: item.mesh for item in items}
    advance = _step_counter("matching", STEPS * len(items), show)
    return [measure(item, meshes, advance) for item in items]


def _step_counter(stage: str, total: int, show: ShowStage) -> Callable[[], None]:
    """Return a function that reports one more finished step of a stage at each call. total: number of steps."""
    done = count(1)
    return lambda: show(stage, next(done), total)


def _diagnose(campaign: Campaign, out: Path, results: Sequence[ObjectResult], show: ShowStage) -> GapSummary:
    """Diagnose the gap from the two datasets alone, without the settings of the campaign, and write its report."""
    report = diagnose(campaign.real, campaign.sim, show=lambda _, done, total: show("diagnosing", done, total)).report
    (out / "gap").mkdir(exist_ok=True)
    text = json.dumps(report, allow_nan=False)
    (out / "gap" / "report.json").write_text(text)
    write_gap_page(json.loads(text), out / "gap" / "report.html")
    printed = {
        name: {row["stage"]: float(row["mean_m"]) for row in select_rows("I_10_to_12_sim_to_real", name)}
        for name in OBJECTS
    }
    return summarise_gap(report, results, {name: {stage: printed[name][stage] for stage in STAGES} for name in OBJECTS})
