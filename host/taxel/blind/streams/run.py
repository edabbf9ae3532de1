"""Execution of the blind check over time: seal the streams, run the twin on each stream, and store its events."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from taxel.blind.seal import commitment
from taxel.blind.streams.emulation import Stream, make_stream
from taxel.blind.streams.world import StreamWorld
from taxel.blind.world_datasets import WorldNotMadeError
from taxel.campaign.poll_cycles import PollCycles
from taxel.gap.fitting.parallel import open_diagnosis_pool
from taxel.output import write_whole
from taxel.twin import Twin, read_reference
from taxel.twin.causes import ReferenceFile
from taxel.twin.naming import CauseNaming
from taxel.twin.session import TwinSession
from taxel.twin.sources import RECORDED_BLOCK, Block

NAMED_AFTER: Final = (1, 10, 30, 100)
"""Numbers of contacts after the onset at which the named cause is scored."""


@dataclass(frozen=True, eq=False)
class CyclesSource:
    """Poll cycles in memory, as a source of a twin."""

    cycles: PollCycles
    is_live: bool = False
    is_continuous: bool = True
    session_starts_s: tuple[float, ...] = ()

    def get_unique_ids(self) -> dict[int, bytes]:
        """Return nothing: no board is exchanged."""
        return {}

    def blocks(self) -> Iterator[Block]:
        """Yield blocks of poll cycles."""
        for start in range(0, len(self.cycles.time_s), RECORDED_BLOCK):
            part = slice(start, start + RECORDED_BLOCK)
            yield Block(self.cycles.time_s[part], self.cycles.raw_counts[part], self.cycles.valid[part])


def seal_streams(out: Path, worlds: Sequence[StreamWorld]) -> None:
    """Write the SHA-256 of every stream's world to `out`/commitments.json; called before any stream is made."""
    out.mkdir(parents=True, exist_ok=True)
    text = json.dumps({str(world.number): commitment(world.to_json()) for world in worlds}, indent=1)
    write_whole(out / "commitments.json", text)


def run_streams(
    out: Path, worlds: Sequence[StreamWorld], jobs: int | None, progress: Callable[[int, int], None]
) -> None:
    """Make each stream that has no result yet, run the twin on it, and write its events to `out`/NUMBER.json.

    jobs: number of processes; None: one per core. progress: called with the number of finished streams and the total.
    """
    missing = [world for world in worlds if not (out / f"{world.number}.json").exists()]
    done = len(worlds) - len(missing)
    progress(done, len(worlds))
    for _ in _run_in_processes(out, missing, jobs):
        done += 1
        progress(done, len(worlds))


def _run_in_processes(out: Path, worlds: Sequence[StreamWorld], jobs: int | None) -> Iterator[None]:
    """Run the streams in `jobs` processes (None: one per core); yield None after each stream, in their order."""
    with open_diagnosis_pool(jobs, len(worlds)) as pool:
        yield from pool.map(partial(run_stream, out), worlds)


def run_stream(out: Path, world: StreamWorld) -> None:
    """Make one stream, run the twin on it, and write its events to a file; an error if the stream cannot be made."""
    reference = out / f"{world.number}.h5"
    try:
        stream = make_stream(world, reference)
    except WorldNotMadeError as error:
        _write(out, world, {"error": str(error)})
        return
    result = watch_stream(stream, reference)
    reference.unlink()
    _write(out, world, {**result, "start_s": stream.start_s, "contacts": [one.end_s for one in stream.schedule]})


def watch_stream(stream: Stream, reference: Path) -> dict[str, object]:
    """Run the twin on a stream; return its events and its largest evidence (an alarm is raised from 1) as JSON values.

    The hidden world is not an input, so that the twin cannot depend on it.
    """
    naming = CauseNaming(ReferenceFile.read(reference), counts=NAMED_AFTER)
    twin = Twin(read_reference(reference), stream.schedule)
    events, evidence = [], 0.0
    for update in TwinSession(twin, CyclesSource(stream.cycles), naming).updates():
        events += [event.to_json() for event in update.events]
        evidence = max([evidence, *(result.evidence for result in update.results)])
    return {"events": events, "evidence": evidence}


def _write(out: Path, world: StreamWorld, result: dict[str, object]) -> None:
    """Write the result of a stream together with its world, which is no longer secret."""
    write_whole(out / f"{world.number}.json", json.dumps({"world": world.to_json(), **result}))
