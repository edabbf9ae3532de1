"""Formats of a recording (capture, MCAP, CSV, Parquet, grasp dataset) and the conversion between them."""

from taxel.recording.formats.conversion import FORMATS, ConversionResult, convert, open_recording

__all__ = ["FORMATS", "ConversionResult", "convert", "open_recording"]
