"""Phase `small_forces`: smallest detectable force with a narrow tip."""

from typing import Final

import numpy as np

from taxel_tools.bench.analysis.curve import extrapolate_detectable_force, find_first_detected_force
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.bench.pictures import draw_small_forces
from taxel_tools.bench.probe import NoProbe
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

SIGMAS: Final = 3.0
SETTLE_FRAMES: Final = 3
FORCES_N: Final = (0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.10)
"""Forces around 0.06 N, which the thesis detected with a 1.9 mm tip (section 2.5)."""


class SmallForces:
    """Phase that applies small forces to several taxels and compares the signals with the noise of one frame."""

    name = "small_forces"
    title = "Smallest detectable force"
    is_automatic = False
    limit_names = frozenset({"visible", "seen"})

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return why small forces cannot be applied (no probe with a known force), or "" with such a probe."""
        if isinstance(board.probe, NoProbe):
            return "no probe; choose one with --probe"
        return "" if board.probe.has_known_force else "an operator cannot set forces this small"

    def check_options(self, options: Options) -> None:
        """Check the options of this phase: `diameter_mm` of the tip; `taxels`: number; `frames` per mean."""
        self._take_options(options)

    def _take_options(self, options: Options) -> tuple[float, int, int]:
        """Take the options of this phase from the test plan.

        Returns diameter of the tip in m, number of taxels, frames per force.
        """
        return (
            options.take_number("diameter_mm", 1.9, 0.2, 10.0) * 1e-3,
            options.take_integer("taxels", 3, 1, 240),
            options.take_integer("frames", 16, 2, 1000),
        )

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Apply increasing small forces to several taxels, and report the smallest force that one frame can detect.

        A force is detectable if its mean signal exceeds `SIGMAS` standard deviations of the noise of one frame.
        "visible" is this force by extrapolation, "seen" the smallest tested force from which on all are detectable.
        """
        diameter_m, count, frames = self._take_options(options)
        options.refuse_unknown_keys()
        forces = np.array(FORCES_N)
        taxels = board.select_inner_taxels(count)
        signals = np.zeros((len(taxels), len(forces)))
        sigmas = np.zeros(len(taxels))
        try:
            for i, taxel in enumerate(taxels):
                rest_counts = board.read_frames(4 * frames).raw_counts[:, taxel].astype(np.float64)
                sigmas[i] = rest_counts.std(ddof=1)
                for step, force in enumerate(forces):
                    board.probe.press(taxel, float(force), diameter_m)
                    signals[i, step] = rest_counts.mean() - board.read_frames(frames, SETTLE_FRAMES).mean[taxel]
                board.probe.release()
                log.report_progress((i + 1) / len(taxels))
        finally:
            board.probe.release()
        signal, noise = signals.mean(axis=0), float(sigmas.mean())
        detectable_n = extrapolate_detectable_force(forces, signal, noise, SIGMAS)
        log.measure("visible", detectable_n, "N")
        log.measure("seen", find_first_detected_force(forces, signal, noise, SIGMAS), "N")
        log.measure("counts_a_newton", float(forces @ signal / (forces @ forces)), "counts/N")
        board.attach_picture(
            log,
            "small_forces.png",
            lambda: draw_small_forces(forces, signal, noise, detectable_n, SIGMAS),
            "Signals under small forces, and the noise of one frame",
        )
