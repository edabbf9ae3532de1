"""A campaign on the emulated hand: sessions in parallel, each through firmware, bus, hub, UART and host, to real.h5."""

from __future__ import annotations

import os
from collections.abc import Sequence
from itertools import groupby

from taxel.campaign.processes import in_processes
from taxel.campaign.progress import Progress, silent
from taxel.campaign.session import check_world, run_session
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.store import begin_or_extend
from taxel.grasp.plan import PlannedGrasp

POLL_BITS = 20_500
"""I2C bits of one poll of the default hand's 17 boards; gives the rate that the sensor table states."""


def run_emulated(
    path: str | os.PathLike[str],
    plan: Sequence[PlannedGrasp],
    settings: EmulatedSettings,
    setup: Setup | None = None,
    jobs: int | None = None,
    overwrite: bool = False,
    resume: bool = False,
    progress: Progress = silent,
) -> None:
    """Make the grasps of `plan` on the emulated hand and write them to `path`.

    jobs: processes; None: one a core. resume: keep the sessions that a file from a cut campaign already has. The
    same plan and settings give the same grasps, whatever `jobs`. Raises `TaxelError` of one line; effects that the
    emulator refuses leave the file as it was.
    """
    setup = setup or Setup()
    check_world(setup, settings)
    with begin_or_extend(path, "real", setup, _rate_hz(settings), settings.describe(), overwrite, resume) as out:
        finished = set(out.ids)
        sessions = [list(part) for _, part in groupby(plan, key=lambda grasp: grasp.session)]
        missing = [part for part in sessions if not finished.issuperset(grasp.id for grasp in part)]
        done = sum(len(part) for part in sessions) - sum(len(part) for part in missing)
        progress(done, len(plan))
        for part, records in zip(missing, in_processes(run_session, setup, missing, settings, jobs), strict=True):
            for planned, record in zip(part, records, strict=True):
                if planned.id not in finished:
                    out.add(record, planned.id)
                done += 1
                progress(done, len(plan))


def _rate_hz(settings: EmulatedSettings) -> float:
    return round(settings.scl_hz / POLL_BITS, 2)
