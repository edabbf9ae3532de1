"""Recordings of touches. See README.md for what this room may import.

>>> recordings()
['P20_thumb_right', 'P2_index_right']
>>> load_recording("P2_index_right").values.shape
(4232, 27, 15)
"""

from taxel.recording.capfingerid import TouchRecording, load_recording, recordings
from taxel.recording.errors import RecordingError
from taxel.recording.tiling import Tiling

__all__ = ["RecordingError", "Tiling", "TouchRecording", "load_recording", "recordings"]
