"""Outputs that survive a crash, a full disk and a second program: whole files and folders, and live recordings."""

from taxel.output.errors import OutputError
from taxel.output.lines import AppendedLines, read_complete_lines
from taxel.output.live import LiveOutput
from taxel.output.pending import PendingOutput
from taxel.output.whole import open_whole, open_whole_text, whole_folder, whole_path, write_whole

__all__ = [
    "AppendedLines",
    "LiveOutput",
    "OutputError",
    "PendingOutput",
    "open_whole",
    "open_whole_text",
    "read_complete_lines",
    "whole_folder",
    "whole_path",
    "write_whole",
]
