"""Settings of the emulated hand, and of the propagation in the simulated clouds, with which chapter 5 is repeated.

The thesis gives neither sizes of its noise, coupling and spread nor the reach of its contact propagation. These were
found by `tools/thesis/search.py`, which says what it aimed at; nothing else was fitted.
"""

from __future__ import annotations

from typing import Final

from taxel.campaign.scatter import Scatter
from taxel.cloud.propagation import Propagation

EFFECTS: Final = (
    "noise pink counts=62",
    "noise line axis=1 counts=4",
    "coupling traces picofarad=9 tx_ohm=400 rx_ohm=400",
    "spread film length_m=0.0038",
    "gain electrode factor=1.4",
)
"""Slow noise is what makes single taxels far from any contact active, as the thesis saw them."""

SCATTER: Final = Scatter(object_m=3.4e-3, object_rad=0.04)
"""Objects were put in their places by hand; the arm, the hand and its calibration have their share."""

PROPAGATION: Final = Propagation(from_counts=340.0)
"""Only taxels that are pressed firmly activate their neighbours."""
