"""Phase `noise`: components of the noise of the untouched board."""

from taxel_tools.bench.analysis.noise import FRAMES_MIN, NoiseParts, separate_noise
from taxel_tools.bench.analysis.noise_faults import TITLES, find_noise_faults
from taxel_tools.bench.board_under_test import BoardUnderTest
from taxel_tools.bench.pictures import draw_board_map, draw_spectrum
from taxel_tools.errors import BoardError
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options


class Noise:
    """Phase that separates white noise, noise shared along lines or by the board, 1/f noise, impulses and drift."""

    name = "noise"
    title = "Noise"
    is_automatic = True
    limit_names = frozenset(TITLES) | {"impulses"}

    def find_unmet_requirement(self, board: BoardUnderTest) -> str:
        """Return "", because the noise phase needs only the board."""
        return ""

    def check_options(self, options: Options) -> None:
        """Check the option of the noise phase, `seconds`: duration of the record of the untouched board."""
        self._take_seconds(options)

    def _take_seconds(self, options: Options) -> float:
        """Take the duration of the record in s from the options; default 12 s."""
        return options.take_number("seconds", 12.0, 2.0, 3600.0)

    def run(self, board: BoardUnderTest, options: Options, log: PhaseLog) -> None:
        """Measure the components of the noise of an untouched board, and report those beyond their limits."""
        seconds = self._take_seconds(options)
        options.refuse_unknown_keys()
        capture = board.read_at_rest(seconds, log)
        if len(capture) < FRAMES_MIN:
            found = (
                f"expected at least {FRAMES_MIN} frames for the noise, found {len(capture)} in {capture.seconds:.1f} s"
            )
            raise BoardError(board.address, f"{found}; increase 'seconds' in the plan")
        scan_s = board.read_status()["scan_time_us"] * 1e-6
        parts = separate_noise(board.kind, capture.raw_counts, capture.rate_hz, scan_s)
        for name, amplitude in parts.amplitudes().items():
            log.measure(name, amplitude, "counts")
        log.measure("impulses", parts.impulses_per_s, "1/s")
        limits = {
            name: limit.maximum for name in TITLES if (limit := log.get_limit(name)) and limit.maximum is not None
        }
        board.evidence.board += find_noise_faults(parts, limits)
        board.noise = parts
        self._attach_pictures(board, parts, capture.rate_hz, log)

    def _attach_pictures(self, board: BoardUnderTest, parts: NoiseParts, rate_hz: float, log: PhaseLog) -> None:
        """Attach pictures of the noise spectrum and of the white noise of each taxel to the log."""
        board.attach_picture(
            log,
            "spectrum.png",
            lambda: draw_spectrum(parts.frequency_hz, parts.spectrum, parts.white, rate_hz),
            "Spectrum of the untouched board",
        )
        board.attach_picture(
            log,
            "noise.png",
            lambda: draw_board_map(board.kind, parts.white_by_taxel, "white noise (counts)"),
            "White noise of each taxel",
        )
