"""Settings of the emulated hand, and of the propagation in the simulated clouds, with which chapter 5 is repeated.

The thesis gives neither sizes of its noise, coupling and spread nor the reach of its contact propagation. These were
found by `tools/thesis/search.py`, which says what it aimed at; nothing else was fitted.
"""

from __future__ import annotations

from typing import Final

from taxel.campaign.scatter import Scatter
from taxel.cloud.propagation import Propagation

EFFECTS: Final = (
    "noise white counts=15",
    "noise line axis=1 counts=4",
    "coupling traces picofarad=2 tx_ohm=400 rx_ohm=400",
    "spread film length_m=0.003",
    "gain electrode factor=1.4",
)

SCATTER: Final = Scatter(object_m=2.2e-3, object_rad=0.03)
"""Objects were put in their places by hand, and the arm and its calibration have their share."""

PROPAGATION: Final = Propagation(from_counts=300.0)
"""Only taxels that are pressed firmly activate their neighbours."""
