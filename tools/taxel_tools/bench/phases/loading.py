"""Loading and unloading with a wide probe, as in the thesis's Figure 2.5."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel_tools.bench.analysis.curve import Curve
from taxel_tools.bench.pictures import loading_curve
from taxel_tools.bench.probe import NoProbe
from taxel_tools.bench.station import Station
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

SETTLE_FRAMES: Final = 3


class Loading:
    """Force up in steps and down again, on several taxels."""

    name = "loading"
    title = "Loading and unloading"
    automatic = False
    limit_names = frozenset({"hysteresis", "fall", "saturation", "spread"})

    def unmet(self, context: Station) -> str:
        """A probe that knows its force is needed, or a person who sets it."""
        return "no probe: give --probe" if isinstance(context.probe, NoProbe) else ""

    def check_options(self, options: Options) -> None:
        """`force_n`: largest; `diameter_mm`; `steps` each way; `taxels`: how many; `frames` for each mean."""
        self._options(options)

    def _options(self, options: Options) -> tuple[float, float, int, int, int]:
        return (
            options.take_number("force_n", 50.0, 0.1, 50.0),
            options.take_number("diameter_mm", 12.0, 0.5, 50.0) * 1e-3,
            options.take_whole("steps", 12, 3, 200),
            options.take_whole("taxels", 10, 1, 240),
            options.take_whole("frames", 4, 1, 1000),
        )

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Load, unload, next."""
        largest, diameter_m, steps, count, frames = self._options(options)
        options.done()
        station = context
        # Counts fall most under small forces, so the steps there are closer.
        forces = largest * (np.arange(steps + 1) / steps) ** 2
        chosen = station.middle_taxels(count)
        loading, unloading = np.zeros((2, len(chosen), steps + 1))
        try:
            for place, taxel in enumerate(chosen):
                rest = max(float(station.frames(4 * frames).mean[taxel]), 1.0)
                for branch, order in ((loading, range(steps + 1)), (unloading, range(steps - 1, -1, -1))):
                    for step in order:
                        station.probe.press(taxel, float(forces[step]), diameter_m)
                        branch[place, step] = station.frames(frames, SETTLE_FRAMES).mean[taxel] / rest
                unloading[place, steps] = loading[place, steps]
                station.probe.release()
                log.progress((place + 1) / len(chosen))
        finally:
            station.probe.release()
        self._judge(station, Curve(forces, loading, unloading), chosen, log)

    def _judge(self, station: Station, curve: Curve, chosen: list[int], log: PhaseLog) -> None:
        log.measure("hysteresis", curve.hysteresis, "of the range")
        log.measure("hysteresis_area", curve.area, "of the area")
        log.measure("fall", 1.0 - float(curve.loading.mean(axis=0)[-1]), "of the count at rest")
        log.measure("saturation", curve.saturation_n, "N")
        log.measure("spread", curve.spread, "of the count at rest")
        if not curve.is_monotonic:
            log.note("the mean count rises with force somewhere: look at the probe's alignment")
        log.note(f"taxels {', '.join(str(taxel) for taxel in chosen)}")
        station.picture(
            log, "loading.png", lambda: loading_curve(curve), "Loading and unloading, mean and standard deviation"
        )
