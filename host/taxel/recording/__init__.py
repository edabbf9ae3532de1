"""Recordings of touches and grasp datasets.

The names that read or write HDF5 files are imported on first use, because they need the optional package h5py.

>>> list_recordings()
['P20_thumb_right', 'P2_index_right']
>>> load_recording("P2_index_right").values.shape
(4232, 27, 15)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from taxel.recording.capfingerid import TouchRecording, list_recordings, load_recording
from taxel.recording.capture_boards import BoardActivity, BoardFrames, read_activity, read_boards
from taxel.recording.errors import DatasetError, RecordingError
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.recording.tiling import Tiling

if TYPE_CHECKING:
    from taxel.recording.from_arrays import write_from_arrays
    from taxel.recording.grasp import Grasp
    from taxel.recording.grasp_dataset import GraspDataset
    from taxel.recording.grasp_writer import DatasetHeader, GraspDatasetWriter

__all__ = [
    "BoardActivity",
    "BoardFrames",
    "DatasetError",
    "DatasetHeader",
    "Grasp",
    "GraspDataset",
    "GraspDatasetWriter",
    "GraspRecord",
    "ObjectMesh",
    "Phase",
    "RecordingError",
    "SensorModel",
    "SensorTable",
    "TaxelTable",
    "Tiling",
    "TouchRecording",
    "list_recordings",
    "load_recording",
    "read_activity",
    "read_boards",
    "write_from_arrays",
]

_MODULE_OF_NAME = {
    "DatasetHeader": "grasp_writer",
    "Grasp": "grasp",
    "GraspDataset": "grasp_dataset",
    "GraspDatasetWriter": "grasp_writer",
    "write_from_arrays": "from_arrays",
}


def __getattr__(name: str) -> Any:
    """Import the submodule that defines `name` on first use, and return the object with this name."""
    if name not in _MODULE_OF_NAME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULE_OF_NAME[name]}"), name)
