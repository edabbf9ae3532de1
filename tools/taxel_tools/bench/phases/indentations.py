"""Phase `presses`: indentation of each taxel."""

from typing import Final

import numpy as np

from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, snr
from taxel.types import BoolArray, FloatArray
from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.analysis.indentations import (
    Indentations,
    find_gain_fault,
    find_response_faults,
    measure_crosstalk,
)
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.bench.pictures import draw_board_map
from taxel_tools.bench.probe import NoProbe
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

WEAKEST_MIN: Final = 0.4
"""Share of the median response below which a taxel is dead, for a plan without this limit."""
SETTLE_FRAMES: Final = 3
"""Frames discarded after each change of the force: a frame may have been scanned before the change."""
MANUAL_S: Final = 3.0
"""Longest time after the operator's confirmation until the counts show the change."""
MANUAL_ATTEMPTS: Final = 2
"""The operator may miss the taxel once; a response at another taxel in both attempts shows swapped lines."""
QUANTISATION_COUNTS: Final = 0.3
"""Standard deviation of the rounding to whole counts: lower limit of the noise of a taxel."""


class EachTaxel:
    """Phase that indents every taxel: response matrix, dead taxels, order of lines, SNR, crosstalk."""

    name = "presses"
    title = "Response of each taxel"
    is_automatic = False
    limit_names = frozenset({"response", "weakest", "snr", "lowest_snr", "crosstalk"})

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return why the taxels cannot be indented (no probe), or "" with a probe."""
        return "no probe; choose one with --probe" if isinstance(board.probe, NoProbe) else ""

    def check_options(self, options: Options) -> None:
        """Check the options of this phase: `force_n` and `diameter_mm` of the probe; `frames` per mean."""
        self._take_options(options)

    def _take_options(self, options: Options) -> tuple[float, float, int]:
        """Take the options of this phase from the test plan.

        Returns force in N, diameter of the tip in m, frames per mean count.
        """
        return (
            options.take_number("force_n", 1.0, 0.01, 50.0),
            options.take_number("diameter_mm", 3.0, 0.5, 20.0) * 1e-3,
            options.take_integer("frames", 6, 1, 1000),
        )

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Indent and release every taxel in turn, and report responses, crosstalk and faults."""
        force_n, diameter_m, frames = self._take_options(options)
        options.refuse_unknown_keys()
        noise = board.noise.white_by_taxel if board.noise else board.read_at_rest(1.0, log).raw_counts.std(axis=0)
        sigma = np.maximum(noise, QUANTISATION_COUNTS)
        try:
            response = self._measure_response(board, force_n, diameter_m, frames, log)
        finally:
            board.probe.release()
        # A response is the difference of two means of `frames` frames.
        error = sigma * np.sqrt(2.0 / frames)
        known_force_n = force_n if board.probe.has_known_force else float("nan")
        self._write_results(board, Indentations(board.kind, response, error, known_force_n), sigma, log)

    def _measure_response(
        self, board: BoardUnderTest, force_n: float, diameter_m: float, frames: int, log: PhaseLog
    ) -> FloatArray:
        """Measure the response matrix f64[taxels, taxels], in counts.

        Row p contains the signals of all taxels while taxel p is indented: counts before the indentation minus counts
        during the indentation.
        """
        count = board.kind.taxel_count
        response = np.full((count, count), np.nan)
        for taxel in range(count):
            rest_counts = board.read_frames(frames).mean
            if board.probe.is_automatic:
                board.probe.press(taxel, force_n, diameter_m)
            else:
                _press_manually(board, taxel, force_n, diameter_m, rest_counts)
            response[taxel] = rest_counts - board.read_frames(frames, SETTLE_FRAMES).mean
            board.probe.release()
            if board.probe.is_automatic:
                board.read_frames(1, SETTLE_FRAMES - 1)  # Discards frames that may precede the release.
            else:
                _wait_for_signal(board, rest_counts, is_pressed=False)
            log.report_progress((taxel + 1) / count)
        return response

    def _write_results(
        self, board: BoardUnderTest, indentations: Indentations, sigma: FloatArray, log: PhaseLog
    ) -> None:
        """Write the measurements and the picture of the indentations to the log, and the faults to the board's
        evidence.

        sigma: standard deviation of the noise of each taxel in one frame, f64[taxels], counts.
        """
        limit = log.get_limit("weakest")
        minimum = limit.minimum if limit is not None and limit.minimum is not None else WEAKEST_MIN
        faults = find_response_faults(indentations, minimum)
        board.evidence.response = faults
        explained = board.find_faulty_taxels()
        own, median = indentations.own_response, indentations.median_response
        weakest = float(np.min(own)) / median if indentations.has_response else None
        log.measure("weakest", weakest, "of the median")
        if np.isfinite(indentations.force_n):
            log.measure("response", indentations.compute_median_response(~explained), "counts")
            ratio = snr(own, sigma)
            healthy_ratio = ratio[~explained] if not explained.all() else ratio
            log.measure("snr", float(np.median(healthy_ratio)), "")
            log.measure("lowest_snr", float(np.min(healthy_ratio)), "")
        if indentations.has_response:
            board.evidence.response = [*faults, *self._find_board_faults(indentations, explained, log)]
        board.attach_picture(
            log,
            "presses.png",
            lambda: draw_board_map(board.kind, own, "signal under indentation (counts)", explained),
            "Signal of each taxel under indentation; faulty taxels have a frame",
        )

    def _find_board_faults(self, indentations: Indentations, explained: BoolArray, log: PhaseLog) -> list[Fault]:
        """Return gain and crosstalk faults of the whole board; write the crosstalk to the log.

        explained: bool[taxels], taxels with another fault, which are excluded.
        """
        faults: list[Fault] = []
        limit = log.get_limit("response")
        if limit is not None:
            gain_fault = find_gain_fault(indentations, indentations.compute_median_response(~explained), *limit.bounds)
            faults += [gain_fault] if gain_fault else []
        limit = log.get_limit("crosstalk")
        crosstalk = measure_crosstalk(indentations, explained)
        for path in crosstalk:
            log.measure("crosstalk", abs(path.share), "of the response", path.path)
        if limit is None:
            return faults
        excessive = [path for path in crosstalk if path.is_significant and not limit.contains(abs(path.share))]
        if excessive:
            share, sign = abs(excessive[0].share), " with opposite sign" if excessive[0].share < 0.0 else ""
            measured = f"{share:.1%} of the response appear {excessive[0].path}{sign}, limit {limit}"
            text = f"{measured}; check for flux residues between traces"
            faults.append(Fault("crosstalk", BOARD, text, limit.severity(share)))
        return faults


def _press_manually(
    board: BoardUnderTest, taxel: int, force_n: float, diameter_m: float, rest_counts: FloatArray
) -> None:
    """Request an indentation by hand until the requested taxel has the largest signal.

    After `MANUAL_ATTEMPTS` requests, the last indentation is kept, whichever taxel responds. rest_counts: f64[taxels],
    raw counts of the untouched board.
    """
    for _ in range(MANUAL_ATTEMPTS):
        board.probe.release()
        board.probe.press(taxel, force_n, diameter_m)
        if int(np.argmax(_wait_for_signal(board, rest_counts, is_pressed=True))) == taxel:
            return


def _wait_for_signal(board: BoardUnderTest, rest_counts: FloatArray, *, is_pressed: bool) -> FloatArray:
    """Wait until a taxel is active (`is_pressed`) or no taxel is active (not `is_pressed`), at most `MANUAL_S`.

    rest_counts: f64[taxels], raw counts of the untouched board. Returns the last signals f64[taxels], also after the
    longest wait.
    """
    start_s = board.wire.now_s()
    while True:
        signal_counts = np.asarray(rest_counts - board.read_frames(2).mean)
        is_active = signal_counts.max() > ACTIVATION_THRESHOLD_COUNTS
        if is_active == is_pressed or board.wire.now_s() - start_s > MANUAL_S:
            return signal_counts
