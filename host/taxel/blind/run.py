"""Execution of a blind check: make the datasets of each world and diagnose them; an interrupted check resumes."""

import json
import os
import shutil
import signal
import time
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from queue import SimpleQueue
from typing import Final

from taxel.blind.reference_parameters import fit_reference_parameters, select_models_to_fit
from taxel.blind.run_folder import COMMITMENTS, SEALED, get_reference_path, get_world_folder, read_json
from taxel.blind.sandboxed_run import SandboxedRunner
from taxel.blind.shuffling import write_shuffled_copy
from taxel.blind.world import World
from taxel.blind.world_datasets import WorldNotMadeError, make_reference, make_world
from taxel.errors import TaxelError
from taxel.output import write_whole

ANALYSIS_SEEDS: Final = 10
SHUFFLED_INTERVAL: Final = 15
"""One in this number of worlds is also diagnosed with exchanged simulations."""

Progress = Callable[[int, int], None]


def run_worlds(
    out: Path,
    worlds: Sequence[World],
    jobs: int | None = None,
    progress: Progress = lambda done, total: None,
    max_seconds: float | None = None,
) -> None:
    """Make the datasets of every world without a result, diagnose them and write the reports below `out`.

    jobs: number of worlds in parallel; None: one per core. progress: called with the number of finished worlds and the
    total. max_seconds: no further world is started after this time.
    """
    deadline = None if max_seconds is None else time.monotonic() + max_seconds
    jobs = jobs or os.cpu_count() or 1
    missing = [world for world in _interleave_hands(worlds) if not (get_world_folder(out, world) / "done").exists()]
    done = len(worlds) - len(missing)
    progress(done, len(worlds))
    if not missing:
        return
    idle_runners: SimpleQueue[SandboxedRunner] = SimpleQueue()
    count = min(jobs, len(missing))
    runners = [SandboxedRunner(out, shares_cores=count > 1) for _ in range(count)]
    for runner in runners:
        idle_runners.put(runner)
    # Ctrl-C must not end the emulator: the run would record the world as not made, as if its plan had no equilibrium.
    ignore = (signal.SIGINT, signal.SIG_IGN)
    makers = ProcessPoolExecutor(len(runners), get_context("spawn"), initializer=signal.signal, initargs=ignore)

    def run_if_in_time(world: World) -> bool:
        """Run one world with an idle sandboxed process; return False, without a run, after the time limit."""
        if deadline is not None and time.monotonic() >= deadline:
            return False
        runner = idle_runners.get()
        try:
            _run_world(out, world, makers, runner)
        finally:
            idle_runners.put(runner)
        return True

    pool = ThreadPoolExecutor(len(runners))
    try:
        for future in as_completed([pool.submit(run_if_in_time, world) for world in missing]):
            done += future.result()
            progress(done, len(worlds))
    finally:  # also after an interrupt: worlds that have not started remain for the next run
        pool.shutdown(cancel_futures=True)
        makers.shutdown(cancel_futures=True)
        for runner in runners:
            runner.close()


def _interleave_hands(worlds: Sequence[World]) -> list[World]:
    """Order the worlds such that those of each hand are spread evenly over the run.

    An interrupted check then contains its share of each hand.
    """
    total, count = Counter(world.hand for world in worlds), Counter[str]()
    position = {}
    for world in worlds:
        position[world.number] = (count[world.hand] + 0.5) / total[world.hand]
        count[world.hand] += 1
    return sorted(worlds, key=lambda world: position[world.number])


def _run_world(out: Path, world: World, makers: ProcessPoolExecutor, runner: SandboxedRunner) -> None:
    """Make the datasets of a world, diagnose them in all required ways, and mark the world as finished.

    makers: processes that make datasets, outside the sandbox. runner: the sandboxed diagnosing process. The reports
    are: report.json (all effects), without.json (hidden effects removed from the catalogue), decoy.json (another effect
    removed), seed*.json (other random seeds) and shuffled.json (simulations of other indentations).
    """
    folder = get_world_folder(out, world)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    real, sim = folder / "real.h5", folder / "sim.h5"
    try:
        attempt = makers.submit(_make_datasets, world, real, sim, _creation_epoch(out)).result()
    except WorldNotMadeError as error:
        write_whole(folder / "done", str(error))
        return
    runner.diagnose(real, sim, folder / "report.json")
    if world.is_withheld:
        runner.diagnose(real, sim, folder / "without.json", sorted(set(world.hidden.names)))
    if world.decoy:
        runner.diagnose(real, sim, folder / "decoy.json", [world.decoy])
    if world.is_repeated:
        for seed in range(1, ANALYSIS_SEEDS):
            runner.diagnose(real, sim, folder / f"seed{seed}.json", (), seed)
    if world.number % SHUFFLED_INTERVAL == 0:
        shuffled = folder / "shuffled.h5"
        makers.submit(write_shuffled_copy, sim, shuffled, world.seed).result()
        runner.diagnose(real, shuffled, folder / "shuffled.json")
    has_reference = world.hidden.kind == "single" and world.hidden.names[0] != "dropout"
    models = select_models_to_fit(world.hidden.causes[0], read_json(folder / "report.json")) if has_reference else set()
    if models:
        noise_free = out / SEALED / f"noise_free{world.number:04d}.h5"
        parameters = makers.submit(_fit_reference, world, noise_free, sim, attempt, models).result()
        write_whole(get_reference_path(out, world), json.dumps(parameters))
    write_whole(folder / "done", "")


def _creation_epoch(out: Path) -> str:
    """Return the creation time that all datasets of a blind check state, seconds since 1970, as text.

    The time is the environment variable `SOURCE_DATE_EPOCH`; without this variable it is the modification time of the
    file of commitments in the folder `out` of the check.
    """
    return os.environ.get("SOURCE_DATE_EPOCH") or str(int((out / COMMITMENTS).stat().st_mtime))


def _make_datasets(world: World, real: Path, sim: Path, epoch: str) -> int:
    """Write the real and the simulated dataset of a world (an emulated skin with hidden causes of a gap).

    Returns the number of the attempt that succeeded, from 0. epoch: creation time that both files state, seconds since
    1970.
    """
    # All datasets state the same creation time, because the run time of the emulator depends on the hidden causes.
    os.environ["SOURCE_DATE_EPOCH"] = epoch
    return make_world(world, real, sim)


def _fit_reference(
    world: World, noise_free: Path, sim: Path, attempt: int, models: Collection[str]
) -> dict[str, dict[str, float]]:
    """Fit the reference parameters of a world, which serve as true values in the score, to noise-free indentations.

    noise_free: temporary file of the indentations. attempt: number of the sampled plan. models: keys of the models to
    fit. Returns the parameters by model key; empty if an indentation has no equilibrium.
    """
    try:
        make_reference(world, noise_free, attempt)
        return fit_reference_parameters(noise_free, sim, world.hidden.names[0], models)
    except TaxelError:
        return {}
    finally:
        noise_free.unlink(missing_ok=True)
