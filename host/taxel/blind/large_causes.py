"""Causes of a demonstration that are large enough for the diagnosis to find them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from taxel.blind.cause_sizes import CauseSizes
from taxel.blind.grasp_world import (
    SESSIONS,
    SIM_REPEATS,
    STRENGTH,
    GraspWorld,
    GraspWorldSampler,
    emulate_grasps,
    list_first_session,
)
from taxel.blind.hidden import Cause
from taxel.blind.loaded_locations import SimulatedLoads
from taxel.blind.sampling import FLOORS
from taxel.campaign.performed_grasp import GraspMemory
from taxel.campaign.progress import Progress, no_progress

LARGE_SIZE: Final = 2.0
"""Gap of a cause in floors from which the diagnosis is specified to name the cause."""

AIMED_SIZE: Final = 2.5
"""Gap in floors for which the strength of a further sample is chosen: above `LARGE_SIZE`, because the size also depends
on the sampled place."""

MAX_STRENGTH: Final = 1.25
"""Largest strength of a cause. Chosen: the parameters of all cause types are still possible on a real skin."""

MOST_TRIALS: Final = 3
"""Largest number of samples of a cause. Afterwards the largest one is used."""

SizeEstimate = Callable[[Cause], float]
"""Function that returns the estimated gap of a cause alone, in floors."""


def sample_large_world(
    sampler: GraspWorldSampler,
    loads: SimulatedLoads,
    cause_sizes: CauseSizes,
    without: Path,
    progress: Progress = no_progress,
    jobs: int | None = None,
    memory: GraspMemory | None = None,
) -> GraspWorld:
    """Sample a world whose causes alone produce `LARGE_SIZE` floors or more, if their types permit it.

    sampler, loads: see `GraspWorldSampler.sample`. cause_sizes: estimates sizes with the simulated dataset of the
    world. without: file to write, the first session without a cause; not written for a world without a cause. The first
    session is also emulated with each sample of a cause. progress: called after each emulated grasp; the total grows
    with every further sample. memory: stores the grasps of the first session, which most causes do not change. Raises
    TaxelError with a one-line message.
    """
    memory = GraspMemory() if memory is None else memory
    world = sampler.sample(loads)
    if not world.hidden.causes:
        return world
    with TemporaryDirectory(prefix="taxel-demo-") as folder:
        first = Path(folder) / "first.h5"
        finished, plan = 0, list_first_session(world.seed)

        def show(done: int, total: int) -> None:
            """Report the progress over all emulated sessions."""
            progress(finished + done, finished + total)

        emulate_grasps(world, without, show, jobs, memory, causes=(), plan=plan)

        def estimate_size(cause: Cause) -> float:
            """Return the estimated gap of a cause alone, in floors."""
            nonlocal finished
            finished += 1
            first.unlink(missing_ok=True)
            emulate_grasps(world, first, show, jobs, memory, causes=(cause,), plan=plan)
            return cause_sizes.estimate(first, without, SESSIONS, SIM_REPEATS)

        causes = tuple(
            enlarge(cause, estimate_size, partial(sampler.sample_cause, number, loads))
            for number, cause in enumerate(world.hidden.causes)
        )
    return replace(world, hidden=replace(world.hidden, causes=causes))


def enlarge(cause: Cause, estimate_size: SizeEstimate, sample: Callable[[float], Cause]) -> Cause:
    """Return a cause with a size of at least `LARGE_SIZE`, or the largest of `MOST_TRIALS` samples.

    cause: the first sample. sample: returns a further sample with a given strength. The logarithm of a cause's
    parameter is linear in the strength, and the size is assumed to be proportional to the parameter: from strength 0 to
    1, the size increases by the ratio of `FLOORS`. The lower limit of the size in the logarithm keeps the step finite.
    """
    best, best_size, strength = cause, estimate_size(cause), sum(STRENGTH) / 2.0
    for _ in range(MOST_TRIALS - 1):
        if best_size >= LARGE_SIZE:
            break
        missing = math.log(AIMED_SIZE / max(best_size, 0.1 * LARGE_SIZE)) / math.log(FLOORS[1] / FLOORS[0])
        strength = min(strength + missing, MAX_STRENGTH)
        other = sample(strength)
        size = estimate_size(other)
        if size > best_size:
            best, best_size = other, size
    return best
