"""Forms of a recording: capture, MCAP, CSV, Parquet and grasp dataset, and the way from each to each."""

from taxel.recording.forms.convert import FORMS, Converted, convert, open_recording

__all__ = ["FORMS", "Converted", "convert", "open_recording"]
