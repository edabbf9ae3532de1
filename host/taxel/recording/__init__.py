"""Recordings of touches, and datasets of grasps. See README.md for what this room may import.

>>> recordings()
['P20_thumb_right', 'P2_index_right']
>>> load_recording("P2_index_right").values.shape
(4232, 27, 15)
"""

from taxel.recording.capfingerid import TouchRecording, load_recording, recordings
from taxel.recording.capture_boards import BoardActivity, BoardFrames, activity_of, read_boards
from taxel.recording.errors import DatasetError, RecordingError
from taxel.recording.from_arrays import write_from_arrays
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.recording.grasp_writer import GraspDatasetWriter
from taxel.recording.tiling import Tiling

__all__ = [
    "BoardActivity",
    "BoardFrames",
    "DatasetError",
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
    "activity_of",
    "load_recording",
    "read_boards",
    "recordings",
    "write_from_arrays",
]
