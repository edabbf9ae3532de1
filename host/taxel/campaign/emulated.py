"""A grasp campaign on the emulated hand: sessions in parallel, each through firmware, bus, hub, UART and host."""

import os
from collections.abc import Sequence
from itertools import chain, groupby

from taxel.campaign.performed_grasp import GraspMemory, PerformedGrasp, perform_grasp
from taxel.campaign.processes import Workers
from taxel.campaign.progress import Progress, no_progress
from taxel.campaign.session import run_session
from taxel.campaign.session_world import check_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.store import open_campaign_writer
from taxel.grasp.plan import PlannedGrasp

POLL_BITS = 20_500
"""I2C bits of one poll cycle of the default hand's 17 boards; determines the rate in the sensor table."""


def run_emulated(
    path: str | os.PathLike[str],
    plan: Sequence[PlannedGrasp],
    settings: EmulatedSettings,
    setup: Setup | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    resume: bool = False,
    progress: Progress = no_progress,
    memory: GraspMemory | None = None,
) -> None:
    """Run the grasps of `plan` on the emulated hand and write them to the dataset `path`.

    setup: hand and objects; None: those of the thesis. jobs: number of processes; None: one per core. overwrite:
    replace an existing file. resume: keep the sessions that the file of an interrupted campaign already contains.
    progress: called with the number of finished grasps and the total. memory: performed grasps of other campaigns with
    the same setup, which are not performed again; the grasps of this campaign are added. The same plan and settings
    give the same grasps for any `jobs` and any memory. Raises `TaxelError` with a one-line message; if the emulator
    rejects the effects, an existing file stays unchanged.
    """
    setup = setup or Setup()
    check_world(setup, settings)
    with open_campaign_writer(
        path, "real", setup, _compute_poll_rate_hz(settings), settings.describe(), overwrite, resume
    ) as out:
        finished = set(out.ids)
        sessions = [list(part) for _, part in groupby(plan, key=lambda grasp: grasp.session)]
        missing = [part for part in sessions if not finished.issuperset(grasp.id for grasp in part)]
        done = sum(len(part) for part in sessions) - sum(len(part) for part in missing)
        progress(done, len(plan))
        with Workers(setup, jobs, len(plan)) as workers:
            # A batch has as many sessions as there are processes. The motions of all its grasps are computed first,
            # then the counts of its sessions.
            for first in range(0, len(missing), workers.count):
                batch = missing[first : first + workers.count]
                grasps = _perform_grasps(workers, batch, settings, memory)
                for part, records in zip(batch, workers.map(run_session, grasps, settings), strict=True):
                    for planned, record in zip(part, records, strict=True):
                        if planned.id not in finished:
                            out.add(record, planned.id)
                        done += 1
                        progress(done, len(plan))


def _perform_grasps(
    workers: Workers, sessions: Sequence[Sequence[PlannedGrasp]], settings: EmulatedSettings, memory: GraspMemory | None
) -> list[list[PerformedGrasp]]:
    """Return the performed grasps of some sessions, by session and in the same order.

    memory: performed grasps of other campaigns, which are not performed again; None: all grasps are performed. The
    grasps that are performed here are added to the memory.
    """
    known = GraspMemory() if memory is None else memory
    missing = known.list_missing(chain.from_iterable(sessions), settings)
    for grasp in workers.map(perform_grasp, missing, settings):
        known.add(grasp, settings)
    return [[known.get(planned, settings) for planned in session] for session in sessions]


def _compute_poll_rate_hz(settings: EmulatedSettings) -> float:
    """Compute the number of poll cycles per second of the emulated skin from its I2C clock, rounded to 0.01."""
    return round(settings.scl_hz / POLL_BITS, 2)
