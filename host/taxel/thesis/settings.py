"""Settings of the emulated hand, and of the propagation in the simulated clouds, with which chapter 5 is repeated.

The thesis gives neither sizes of its noise, coupling and spread nor the reach of its contact propagation. These were
found by `tools/thesis/search.py`, which says what it aimed at; nothing else was fitted.
"""

from __future__ import annotations

from typing import Final

from taxel.campaign.scatter import Scatter
from taxel.cloud.propagation import Propagation

EFFECTS: Final = (
    "noise pink counts=54",
    "noise pink counts=90 board=0x2e",
    "noise line axis=1 counts=4",
    "coupling traces picofarad=9 tx_ohm=400 rx_ohm=400",
    "spread film length_m=0.0042",
    "gain electrode factor=1.4",
    "saturation clip counts=230 strength=0.88",
)
"""Slow noise is what makes single taxels far from any contact active, as the thesis saw them; one small board of a
finger whose tip has failed (5.2) has more of it. Counts above 230 rise an eighth as fast: the thesis's force filter
takes few points up to 190 and most of them soon after (Tables I-1 to I-3). That knee differs from taxel to taxel, since
the coupling shifts their rest.
"""

SCATTER: Final = Scatter(object_m=4.4e-3, object_rad=0.015, heading_rad=0.14)
"""Objects were put in their places by hand; the arm, the hand and its calibration have their share. What stands on its
base turns more than it tilts.
"""

PROPAGATION: Final = Propagation(reach_m=0.0075, from_counts=500.0)
"""Only taxels that are pressed firmly activate their neighbours, the diagonal ones too."""
