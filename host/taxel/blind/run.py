"""The whole blind check: seal, make, diagnose elsewhere, open, score. It goes on where it was cut."""

from __future__ import annotations

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
from typing import Any, Final

from taxel.blind.drawing import World, drawn_worlds
from taxel.blind.errors import BlindRunError
from taxel.blind.lane import Lane
from taxel.blind.making import WorldNotMadeError, make_reference, make_world
from taxel.blind.reference import forms_to_fit, reference_parameters
from taxel.blind.seal import check, commitment
from taxel.blind.shuffling import shuffled_copy
from taxel.errors import TaxelError

SEALED: Final = "sealed"
COMMITMENTS, KEYS, WORLDS = "commitments.json", f"{SEALED}/keys.json", "worlds"
SEEDS: Final = 10
SHUFFLED_EVERY: Final = 15

Show = Callable[[int, int], None]


def seal(out: Path, count: int, full_hand: int, seed: int | None) -> list[World]:
    """Draw worlds, publish their commitments, and store the keys; or take those that a cut run has left.

    Raises BlindRunError for a folder that holds something else, SealBrokenError for one that was changed.
    """
    keys = out / KEYS
    if keys.exists():
        worlds = opened(out)
        whole = sum(world.hand != "rig4" for world in worlds)
        if (len(worlds) - whole, whole) != (count, full_hand):
            asked, found = (
                f"{number} worlds and {more} of the full hand"
                for number, more in ((count, full_hand), (len(worlds) - whole, whole))
            )
            raise BlindRunError(str(out), asked, found, "choose another --out")
        return worlds
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        expected = "an empty folder, or a blind check to go on with"
        raise BlindRunError(str(out), expected, "other files", "choose another --out")
    worlds = drawn_worlds(count, full_hand, seed)
    published = {str(world.number): commitment(world.to_json()) for world in worlds}
    keys.parent.mkdir(parents=True, exist_ok=True)
    (out / COMMITMENTS).write_text(json.dumps(published, indent=0))
    hidden = keys.with_suffix(".part")
    hidden.touch(mode=0o600)
    hidden.write_text(json.dumps([world.to_json() for world in worlds]))
    hidden.rename(keys)
    return worlds


def opened(out: Path) -> list[World]:
    """The keys, each checked against what was committed to. Raises SealBrokenError, BlindRunError."""
    if not (out / KEYS).exists():
        raise BlindRunError(str(out), "a blind check", "none", "run `taxel gap blind` with --worlds first")
    committed, keys = _json(out / COMMITMENTS), _json(out / KEYS)
    for key in keys:
        check(int(key["number"]), key, str(committed.get(str(key["number"]), "")))
    if len(keys) != len(committed):
        raise BlindRunError(str(out / KEYS), f"{len(committed)} keys", str(len(keys)), "run the check anew")
    return [World.from_json(key) for key in keys]


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise BlindRunError(str(path), "readable JSON", str(error), "run the check anew") from None


def run_worlds(
    out: Path,
    worlds: Sequence[World],
    jobs: int | None = None,
    show: Show = lambda done, total: None,
    seconds: float | None = None,
) -> None:
    """Make and diagnose every world that has no result yet. jobs: worlds at a time; None: one a core.

    seconds: no world is begun after so many.
    """
    until = None if seconds is None else time.monotonic() + seconds
    jobs = jobs or os.cpu_count() or 1
    missing = [world for world in _evenly(worlds) if not (out / WORLDS / f"{world.number:04d}" / "done").exists()]
    done = len(worlds) - len(missing)
    show(done, len(worlds))
    if not missing:
        return
    lanes: SimpleQueue[Lane] = SimpleQueue()
    own = [Lane(out) for _ in range(min(jobs, len(missing)))]
    for lane in own:
        lanes.put(lane)
    # An emulator that Ctrl-C ends would look like a plan that cannot be pressed.
    ignore = (signal.SIGINT, signal.SIG_IGN)
    makers = ProcessPoolExecutor(len(own), get_context("spawn"), initializer=signal.signal, initargs=ignore)

    def one(world: World) -> bool:
        if until is not None and time.monotonic() >= until:
            return False
        lane = lanes.get()
        try:
            _one_world(out, world, makers, lane)
        finally:
            lanes.put(lane)
        return True

    pool = ThreadPoolExecutor(len(own))
    try:
        for future in as_completed([pool.submit(one, world) for world in missing]):
            done += future.result()
            show(done, len(worlds))
    finally:  # also when it is cut: worlds that have not begun are left for the next time
        pool.shutdown(cancel_futures=True)
        makers.shutdown(cancel_futures=True)
        for lane in own:
            lane.close()


def _evenly(worlds: Sequence[World]) -> list[World]:
    """In order, each hand's spread over the whole: a run that is cut has its share of all of them."""
    total, before = Counter(world.hand for world in worlds), Counter[str]()
    place = {}
    for world in worlds:
        place[world.number] = (before[world.hand] + 0.5) / total[world.hand]
        before[world.hand] += 1
    return sorted(worlds, key=lambda world: place[world.number])


def _one_world(out: Path, world: World, makers: ProcessPoolExecutor, lane: Lane) -> None:
    folder = out / WORLDS / f"{world.number:04d}"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    real, sim = folder / "real.h5", folder / "sim.h5"
    try:
        attempt = makers.submit(_make, world, real, sim, _sealed_at(out)).result()
    except WorldNotMadeError as error:
        (folder / "done").write_text(str(error))
        return
    lane.diagnose(real, sim, folder / "report.json")
    if world.withheld:
        lane.diagnose(real, sim, folder / "without.json", sorted(set(world.hidden.names)))
    if world.decoy:
        lane.diagnose(real, sim, folder / "decoy.json", [world.decoy])
    if world.repeated:
        for seed in range(1, SEEDS):
            lane.diagnose(real, sim, folder / f"seed{seed}.json", (), seed)
    if world.number % SHUFFLED_EVERY == 0:
        shuffled = folder / "shuffled.h5"
        makers.submit(shuffled_copy, sim, shuffled, world.seed).result()
        lane.diagnose(real, shuffled, folder / "shuffled.json")
    single = world.hidden.kind == "single" and world.hidden.names[0] != "dropout"
    forms = forms_to_fit(world.hidden.causes[0], _json(folder / "report.json")) if single else set()
    if forms:
        # Not beside the published files: that there is one would tell the kind of world.
        still = out / SEALED / f"still{world.number:04d}.h5"
        found = makers.submit(_reference, world, still, sim, attempt, forms).result()
        (out / SEALED / f"reference{world.number:04d}.json").write_text(json.dumps(found))
    (folder / "done").write_text("")


def _sealed_at(out: Path) -> str:
    """When the commitments were published, or `SOURCE_DATE_EPOCH`: seconds since 1970."""
    return os.environ.get("SOURCE_DATE_EPOCH") or str(int((out / COMMITMENTS).stat().st_mtime))


def _make(world: World, real: Path, sim: Path, epoch: str) -> int:
    # Every dataset says that it was made at one time: how long the emulator took hangs on what the world hides.
    os.environ["SOURCE_DATE_EPOCH"] = epoch
    return make_world(world, real, sim)


def _reference(
    world: World, still: Path, sim: Path, attempt: int, forms: Collection[str]
) -> dict[str, dict[str, float]]:
    """No parameters where the presses do not come to rest without scatter."""
    try:
        make_reference(world, still, attempt)
        return reference_parameters(still, sim, world.hidden.names[0], forms)
    except TaxelError:
        return {}
    finally:
        still.unlink(missing_ok=True)
