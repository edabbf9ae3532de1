"""Writer of a campaign's dataset: a new file, or the continuation of an interrupted campaign."""

import json
import os
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from taxel.campaign.setup import Setup
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter


def open_campaign_writer(
    path: str | os.PathLike[str],
    source: str,
    setup: Setup,
    rate_hz: float,
    settings: str,
    overwrite: bool = False,
    resume: bool = False,
    sensor_model: SensorModel | None = None,
) -> GraspDatasetWriter:
    """Open a writer for the grasp dataset of a campaign.

    source: "real" or "sim". rate_hz: frame rate of every board. settings: one line that describes the settings. resume:
    append to an existing file, which must have been made with the same settings; make a new file if there is none.
    sensor_model: how forces become counts, only for a simulated campaign. Raises `DatasetError` if the file exists and
    neither `overwrite` nor `resume` is set, and if the file to resume belongs to another campaign.
    """
    generator = f"taxel {version('taxel')}; {settings}"
    if resume and Path(path).exists():
        expected = f"{source} {setup.hand.name}; {generator}"
        with GraspDataset(path) as data:
            found = f"{data.source} {data.hand}; {data.generator}"
        if found != expected:
            action = "the file belongs to another campaign; choose another file"
            raise DatasetError(str(path), "/generator", expected, found, action)
        return GraspDatasetWriter.extend(path)
    return GraspDatasetWriter.create(
        path,
        DatasetHeader(
            source=source,
            hand=setup.hand.name,
            taxels=setup.taxel_table(),
            sensors=setup.sensor_table(rate_hz),
            objects=setup.meshes(),
            generator=generator,
            sensor_model=sensor_model,
            created=_read_creation_time(),
            notes={} if setup.calibration is None else {"calibration": json.dumps(setup.calibration.to_json())},
        ),
        overwrite=overwrite,
    )


def _read_creation_time() -> str | None:
    """Return the time in the environment variable `SOURCE_DATE_EPOCH` (Unix time) in ISO format.

    With a fixed creation time, the same campaign gives the same file. None if the variable is not set or not a number;
    the dataset then states the present time.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    return datetime.fromtimestamp(int(epoch), UTC).isoformat() if epoch.isdecimal() else None
