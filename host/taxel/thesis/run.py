"""The reproduction of chapter 5 in one folder: campaigns, tables, figures, findings, diagnosis and page."""

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any, Final

import numpy as np
from threadpoolctl import threadpool_limits

from taxel.campaign.emulated import run_emulated
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.cloud.errors import CloudError
from taxel.errors import TaxelError
from taxel.gap.diagnosis import diagnose
from taxel.gap.page import write_page as write_gap_page
from taxel.grasp.plan import make_thesis_plan
from taxel.output import write_whole
from taxel.recording.grasp_dataset import GraspDataset
from taxel.thesis.figures import find_figures, save_figures
from taxel.thesis.gap_summary import GapSummary, summarise_gap
from taxel.thesis.matching import STEPS, ObjectClouds, accumulate_clouds, measure
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.page import PageContent, write_page
from taxel.thesis.printed import OBJECTS, STAGES, select_rows
from taxel.thesis.seed_result import UNCHECKED, SeedResult, read_seed_result
from taxel.thesis.settings import (
    EFFECTS,
    OBJECT_VARIATION,
    SEARCH_SEEDS,
    SIM_LAYER_M,
    SIM_VARIATION,
    describe_settings,
)
from taxel.thesis.shape_matching import STEPS as SHAPE_STEPS
from taxel.thesis.shape_matching import count_identified_shapes
from taxel.thesis.summary import Summary
from taxel.thesis.tables import build_tables

ShowStage = Callable[[str, int, int], None]
"""Called with the name of a stage, the finished steps of the stage and the number of all its steps."""

SIM_SEED_STEP: Final = 1
"""Difference between the seeds of the simulator and of the emulated hand, so that their noise differs."""


@dataclass(frozen=True)
class Campaign:
    """The real (or emulated) and the simulated dataset of a reproduction.

    description: sentences on how the datasets were made. seed, settings: seed and settings with which they were made;
    None and empty for existing datasets.
    """

    real: Path
    sim: Path
    description: tuple[str, ...]
    seed: int | None = None
    settings: Mapping[str, Any] = field(default_factory=lambda: UNCHECKED)


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
    sim_setup = Setup(replace(setup.hand, layer_m=SIM_LAYER_M), setting="simulation", torques="simulation")
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
        f"{len(plan)} grasps on each side. The real side is the emulated hand with {'; '.join(EFFECTS)}. "
        "Tool poses and torques are those of the original hardware. The object pose "
        f"varies by {1e3 * OBJECT_VARIATION.object_m:.2g} mm and {np.degrees(OBJECT_VARIATION.object_rad):.2g} degrees "
        "(standard deviation of each axis in each grasp).",
        f"The simulated side is the simulator with an elastic layer of {1e3 * SIM_LAYER_M:.1f} mm, without these "
        "effects, with the tool poses and torques of the original simulation.",
    )
    return Campaign(real, sim, description, seed, describe_settings())


def use_existing_campaign(real: Path, sim: Path) -> Campaign:
    """Return a campaign that consists of two existing datasets, real and simulated."""
    return Campaign(real, sim, (f"Real side: {real.name}. Simulated side: {sim.name}.",))


def reproduce(
    campaign: Campaign, out: Path, show: ShowStage, *, with_gap: bool = True
) -> tuple[Summary, GapSummary | None]:
    """Write tables, figures, findings and the page of a campaign to the folder `out`; return the summaries.

    with_gap: whether to diagnose the gap; the second result is None if not. Raises TaxelError.
    """
    result = analyse(campaign, out, show)
    gap = _diagnose(campaign, out, result.objects, show) if with_gap else None
    return _write_outputs(out, [result], out, gap), gap


def reproduce_seeds(out: Path, seeds: Sequence[int], jobs: int | None, show: ShowStage) -> Summary:
    """Run campaigns and analysis of several seeds, and write the page with their median and worst to `out`.

    The folder `seed_N` contains the campaigns and results of seed N. A seed with stored results is not run again, and
    an interrupted seed is continued. Raises TaxelError, also for a seed that was used in the search of settings.
    """
    searched = [seed for seed in seeds if seed in SEARCH_SEEDS]
    if searched:
        raise TaxelError(
            f"--seeds: expected seeds that were not used in the search of settings, found {searched[0]}; "
            f"use seeds above {max(SEARCH_SEEDS)}, such as 101-110"
        )
    results = []
    for done, seed in enumerate(seeds):
        show("seeds", done, len(seeds))
        folder = out / f"seed_{seed}"
        folder.mkdir(parents=True, exist_ok=True)
        stored = read_seed_result(folder)
        results.append(stored or analyse(make_campaign(folder, seed, jobs, show), folder, show))
    show("seeds", len(seeds), len(seeds))
    folders = [out / f"seed_{seed}" for seed in seeds]
    summary = Summary(results)
    return _write_outputs(out, results, folders[summary.shown], None)


def analyse(campaign: Campaign, out: Path, show: ShowStage) -> SeedResult:
    """Compute all results of a campaign, and write its tables, figures and results to the folder `out`.

    Linear algebra uses one thread: with small matrices, more threads double the CPU time. Raises TaxelError.
    """
    with threadpool_limits(limits=1):
        return _analyse(campaign, out, show)


def _analyse(campaign: Campaign, out: Path, show: ShowStage) -> SeedResult:
    """Do the work of `analyse` without a limit of the number of threads."""
    with closing(GraspDataset(campaign.real)) as real, closing(GraspDataset(campaign.sim)) as sim:
        items = _accumulate_objects(real, sim, show)
    results = _measure_objects(items, show)
    (out / "tables").mkdir(parents=True, exist_ok=True)
    for table in build_tables(results):
        table.write(out / "tables" / table.file_name)
    (out / "figures").mkdir(exist_ok=True)
    save_figures(items, results, out / "figures")
    shapes = count_identified_shapes(items, _step_counter("shapes", SHAPE_STEPS * len(items), show))
    result = SeedResult(campaign.seed, campaign.description, campaign.settings, tuple(results), tuple(shapes))
    result.write(out)
    return result


def _write_outputs(out: Path, results: Sequence[SeedResult], shown_folder: Path, gap: GapSummary | None) -> Summary:
    """Write the page (thesis.html) and the summary (thesis.json) of one or more seeds to the folder `out`.

    shown_folder: folder that contains the figures of the shown seed. gap: None: not diagnosed. Returns the summary.
    """
    summary = Summary(results)
    shown = results[summary.shown]
    tables, figures = build_tables(shown.objects), find_figures(shown_folder / "figures")
    write_page(out / "thesis.html", PageContent(summary, tables, figures, gap, shown.made))
    values = {
        "made": shown.made,
        **summary.to_json(),
        "objects": [result.to_json() for result in shown.objects],
        "gap": None if gap is None else gap.to_json(),
    }
    write_whole(out / "thesis.json", json.dumps(values, indent=1))
    return summary


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
    write_whole(out / "gap" / "report.json", text)
    write_gap_page(json.loads(text), out / "gap" / "report.html")
    printed = {
        name: {row["stage"]: float(row["mean_m"]) for row in select_rows("I_10_to_12_sim_to_real", name)}
        for name in OBJECTS
    }
    return summarise_gap(report, results, {name: {stage: printed[name][stage] for stage in STAGES} for name in OBJECTS})
