"""The smallest force that can be seen, with a narrow probe."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel_tools.bench.analysis.curve import first_visible, smallest_visible
from taxel_tools.bench.pictures import small_forces
from taxel_tools.bench.probe import NoProbe
from taxel_tools.bench.station import Station
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

SIGMAS: Final = 3.0
SETTLE_FRAMES: Final = 3
LADDER_N: Final = (0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.10)
"""Around the 0.06 N that the thesis saw with a 1.9 mm probe (section 2.5)."""


class SmallForces:
    """A ladder of small forces on a few taxels; the force whose signal stands out of one frame's noise."""

    name = "small_forces"
    title = "Smallest visible force"
    automatic = False
    limit_names = frozenset({"visible", "seen"})

    def unmet(self, context: Station) -> str:
        """A probe that knows its force is needed."""
        if isinstance(context.probe, NoProbe):
            return "no probe: give --probe"
        return "" if context.probe.knows_force else "forces this small cannot be set by hand"

    def check_options(self, options: Options) -> None:
        """`diameter_mm`; `taxels`: how many; `frames` for each mean."""
        self._options(options)

    def _options(self, options: Options) -> tuple[float, int, int]:
        return (
            options.take_number("diameter_mm", 1.9, 0.2, 10.0) * 1e-3,
            options.take_whole("taxels", 3, 1, 240),
            options.take_whole("frames", 16, 2, 1000),
        )

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Press ever harder, on each taxel."""
        diameter_m, count, frames = self._options(options)
        options.done()
        station = context
        forces = np.array(LADDER_N)
        chosen = station.middle_taxels(count)
        signals = np.zeros((len(chosen), len(forces)))
        sigmas = np.zeros(len(chosen))
        try:
            for place, taxel in enumerate(chosen):
                untouched = station.frames(4 * frames).raw_counts[:, taxel].astype(np.float64)
                sigmas[place] = untouched.std(ddof=1)
                for step, force in enumerate(forces):
                    station.probe.press(taxel, float(force), diameter_m)
                    signals[place, step] = untouched.mean() - station.frames(frames, SETTLE_FRAMES).mean[taxel]
                station.probe.release()
                log.progress((place + 1) / len(chosen))
        finally:
            station.probe.release()
        signal, noise = signals.mean(axis=0), float(sigmas.mean())
        visible = smallest_visible(forces, signal, noise, SIGMAS)
        log.measure("visible", visible, "N")
        log.measure("seen", first_visible(forces, signal, noise, SIGMAS), "N")
        log.measure("counts_a_newton", float(forces @ signal / (forces @ forces)), "counts/N")
        station.picture(
            log,
            "small_forces.png",
            lambda: small_forces(forces, signal, noise, visible, SIGMAS),
            "Signals under small forces, against the noise of one frame",
        )
