"""Live view of the skin: a model that processes every frame, and views on a terminal, in a browser and as lines."""

from taxel.monitor.history import History
from taxel.monitor.line_view import LineView, OnceView
from taxel.monitor.model import SkinMonitor
from taxel.monitor.paced_link import PacedLink, SpeedError, open_paced
from taxel.monitor.reading import BoardReading, SkinReading
from taxel.monitor.run import View, watch
from taxel.monitor.screen import Screen
from taxel.monitor.terminal import TerminalView

__all__ = [
    "BoardReading",
    "History",
    "LineView",
    "OnceView",
    "PacedLink",
    "Screen",
    "SkinMonitor",
    "SkinReading",
    "SpeedError",
    "TerminalView",
    "View",
    "open_paced",
    "watch",
]
