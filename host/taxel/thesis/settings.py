"""Settings of the emulated hand, and of the propagation in the simulated clouds, with which chapter 5 is repeated.

The thesis gives neither sizes of its noise, coupling and spread nor the reach of its contact propagation. These were
found with `tools/thesis/search.py`, which says what it aimed at; the knee of the counts, the noisier board, the depth
of the brackets, the simulator's layer and the press on the prism were then chosen on whole campaigns (docs/thesis.md).
All but that press and how firmly objects stand are the same for all objects.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from taxel.campaign.variation import NO_VARIATION, Variation
from taxel.cloud.propagation import Propagation
from taxel.grasp.plan import PLACINGS

PRISM: Final = "triangular_prism"
PRISM_PRESS_M: Final = 0.0003

EFFECTS: Final = (
    "noise pink counts=50",
    "noise pink counts=116 board=0x2d",
    "noise line axis=1 counts=4",
    "coupling traces picofarad=9 tx_ohm=400 rx_ohm=400",
    "spread film length_m=0.0038",
    "gain electrode factor=1.5",
    "saturation clip counts=295 strength=0.98",
)
"""Slow noise is what makes single taxels far from any contact active, as the thesis saw them; one small board of a
finger whose tip has failed (5.2) has more of it. Counts hardly rise above 295: the thesis's force filter takes few
points up to 190 and most of them up to 320 (Tables I-1 to I-3). That knee differs from taxel to taxel, since the
coupling shifts their rest.
"""

DEEPER_M: Final = 0.0004
"""Every bracket lies this much deeper in the hand than its model has it, as where a printed mount gives. Contacts are
then believed to lie nearer to the objects, or in them: without it the triangular prism's cloud hardly lies nearer to
its own CAD than to the others (finding 12).
"""


def effects_on(boards: Iterable[str]) -> tuple[str, ...]:
    """`EFFECTS`, and the brackets of these boards where they truly are."""
    return (*EFFECTS, *(f"bracket_offset {name} 0 0 {-DEEPER_M:g} 0 0 0" for name in boards))


STANDS: Final = (("rectangular_prism", 0.68), ("cylinder", 0.77), ("triangular_prism", 1.1))
"""How far these stand from their places, as a share of what `SCATTER` says: found with `tools/thesis/search.py`, and
changed by a few hundredths on whole campaigns."""

SCATTER: Final = Variation(object_m=3.4e-3, object_rad=0.04, objects=STANDS)
"""Objects were put in their places by hand; the arm, the hand and its calibration have their share."""

TOUCHED: Final = {
    (item, approach): replace(placing, press_m=PRISM_PRESS_M) if item == PRISM and not placing.top else placing
    for (item, approach), placing in PLACINGS.items()
}
"""How the hand meets the objects. The thesis's simulated contacts lie 1.53 mm from the triangular prism, twice as far
as from the others (Tables I-7 to I-9): on its sides the palm hardly presses it.
"""

SIM_SCATTER: Final = NO_VARIATION
"""In the thesis's simulator the object stands where its model says (4.3)."""

SIM_LAYER_M: Final = 0.0016
"""Thickness of the simulator's layer. The thesis's is rigid and as thick as the dielectric under 50 N, about 1 mm
(4.2.1); ours bears like springs, and its electrodes come as near to the object as the thesis's with this thickness,
between that and the 2 mm at rest.
"""

PROPAGATION: Final = Propagation(min_signal_counts=340.0)
"""Only taxels that are pressed firmly activate their neighbours."""
