"""The phases that a plan can name."""

from __future__ import annotations

from typing import Final

from taxel_tools.bench.phases.drift import Drift
from taxel_tools.bench.phases.electrical import Electrical
from taxel_tools.bench.phases.faults import Faults
from taxel_tools.bench.phases.frames import Frames
from taxel_tools.bench.phases.identify import Identify
from taxel_tools.bench.phases.loading import Loading
from taxel_tools.bench.phases.noise import Noise
from taxel_tools.bench.phases.presses import PressEach
from taxel_tools.bench.phases.rest import Rest
from taxel_tools.bench.phases.small_forces import SmallForces
from taxel_tools.bench.phases.soak import Soak
from taxel_tools.testing.engine import Phase

PHASES: Final[tuple[Phase, ...]] = (
    Identify(),
    Electrical(),
    Rest(),
    Noise(),
    Drift(),
    Frames(),
    PressEach(),
    Loading(),
    SmallForces(),
    Soak(),
    Faults(),
)

__all__ = ["PHASES"]
