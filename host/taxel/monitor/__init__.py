"""The skin as it is now: a model that takes every frame, and views of it on a terminal and in a browser."""

from taxel.monitor.history import History
from taxel.monitor.model import SkinMonitor
from taxel.monitor.paced import PacedLink, SpeedError, open_watched
from taxel.monitor.plain import LineView, OnceView
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
    "open_watched",
    "watch",
]
