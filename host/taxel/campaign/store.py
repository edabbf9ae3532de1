"""The dataset that a campaign writes to: a new one, or one that a cut campaign left."""

from __future__ import annotations

import json
import os
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from taxel.campaign.setup import Setup
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_writer import GraspDatasetWriter


def begin_or_extend(
    path: str | os.PathLike[str],
    source: str,
    setup: Setup,
    rate_hz: float,
    settings: str,
    overwrite: bool = False,
    resume: bool = False,
    sensor_model: SensorModel | None = None,
) -> GraspDatasetWriter:
    """A writer for `path`. `resume`: go on with a file that is there; it must come from the same settings.

    Raises `DatasetError` for a file that exists without `overwrite` or `resume`, and for one of another campaign.
    """
    generator = f"taxel {version('taxel')}; {settings}"
    if resume and Path(path).exists():
        with GraspDataset(path) as data:
            found, wanted = f"{data.source} {data.hand}; {data.generator}", f"{source} {setup.hand.name}; {generator}"
        if found != wanted:
            raise DatasetError(str(path), "/generator", wanted, found, "it is of another campaign; choose another file")
        return GraspDatasetWriter.extend(path)
    return GraspDatasetWriter.create(
        path,
        source=source,
        hand=setup.hand.name,
        taxels=setup.taxel_table(),
        sensors=setup.sensor_table(rate_hz),
        objects=setup.meshes(),
        generator=generator,
        sensor_model=sensor_model,
        created=_created(),
        notes={} if setup.calibration is None else {"calibration": json.dumps(setup.calibration.to_json())},
        overwrite=overwrite,
    )


def _created() -> str | None:
    """`SOURCE_DATE_EPOCH` (seconds since 1970) if it is set: the same seed then gives the same bytes. None: now."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(epoch), UTC).isoformat() if epoch.isdecimal() else None
