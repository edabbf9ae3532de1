"""Phase `loading`: loading and unloading curve with a wide tip, as in Figure 2.5 of the thesis."""

from typing import Final

import numpy as np

from taxel_tools.bench.analysis.curve import Curve
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.bench.pictures import draw_loading_curve
from taxel_tools.bench.probe import NoProbe
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

SETTLE_FRAMES: Final = 3


class Loading:
    """Phase that loads and unloads several taxels in steps of the force."""

    name = "loading"
    title = "Loading and unloading"
    is_automatic = False
    limit_names = frozenset({"hysteresis", "fall", "saturation", "spread"})

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return why taxels cannot be loaded (no probe), or "" with a probe."""
        return "no probe; choose one with --probe" if isinstance(board.probe, NoProbe) else ""

    def check_options(self, options: Options) -> None:
        """Check the options of the loading phase.

        `force_n`: largest force; `diameter_mm`: diameter of the tip; `steps`: force steps in each direction; `taxels`:
        number of taxels; `frames`: frames per mean count.
        """
        self._take_options(options)

    def _take_options(self, options: Options) -> tuple[float, float, int, int, int]:
        """Take the options of this phase from the test plan.

        Returns largest force in N, diameter of the tip in m, force steps, number of taxels, frames per step.
        """
        return (
            options.take_number("force_n", 50.0, 0.1, 50.0),
            options.take_number("diameter_mm", 12.0, 0.5, 50.0) * 1e-3,
            options.take_integer("steps", 12, 3, 200),
            options.take_integer("taxels", 10, 1, 240),
            options.take_integer("frames", 4, 1, 1000),
        )

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Load and unload several taxels in steps, one after the other, and report the loading curve."""
        force_max_n, diameter_m, steps, count, frames = self._take_options(options)
        options.refuse_unknown_keys()
        # The signal rises fastest at small forces, so the steps are closer there.
        forces = force_max_n * (np.arange(steps + 1) / steps) ** 2
        taxels = board.select_inner_taxels(count)
        loading, unloading = np.zeros((2, len(taxels), steps + 1))
        try:
            for i, taxel in enumerate(taxels):
                rest_count = max(float(board.read_frames(4 * frames).mean[taxel]), 1.0)
                for branch, order in ((loading, range(steps + 1)), (unloading, range(steps - 1, -1, -1))):
                    for step in order:
                        board.probe.press(taxel, float(forces[step]), diameter_m)
                        branch[i, step] = board.read_frames(frames, SETTLE_FRAMES).mean[taxel] / rest_count
                unloading[i, steps] = loading[i, steps]
                board.probe.release()
                log.report_progress((i + 1) / len(taxels))
        finally:
            board.probe.release()
        self._write_results(board, Curve(forces, loading, unloading), taxels, log)

    def _write_results(self, board: BoardUnderTest, curve: Curve, taxels: list[int], log: PhaseLog) -> None:
        """Write measurements, notes and the picture of the loading curve to the log."""
        log.measure("hysteresis", curve.hysteresis, "of the range")
        log.measure("hysteresis_area", curve.area, "of the area")
        log.measure("fall", 1.0 - float(curve.loading.mean(axis=0)[-1]), "of the count at rest")
        log.measure("saturation", curve.saturation_n, "N")
        log.measure("spread", curve.spread, "of the count at rest")
        if not curve.is_monotonic:
            log.add_note("the mean count increases with the force in one step; check the alignment of the probe")
        log.add_note(f"taxels {', '.join(str(taxel) for taxel in taxels)}")
        board.attach_picture(
            log, "loading.png", lambda: draw_loading_curve(curve), "Loading and unloading, mean and standard deviation"
        )
