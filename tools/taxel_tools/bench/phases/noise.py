"""Noise of the untouched board, taken apart."""

from __future__ import annotations

from taxel_tools.bench.analysis.noise import FRAMES_MIN, NoiseParts, noise_parts
from taxel_tools.bench.analysis.noise_names import TITLES, noise_faults
from taxel_tools.bench.pictures import board_map, spectrum
from taxel_tools.bench.station import Station
from taxel_tools.errors import BoardError
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options


class Noise:
    """White, shared along lines, shared by the board, 1/f, impulses, wandering; and the spectrum."""

    name = "noise"
    title = "Noise"
    automatic = True
    limit_names = frozenset(TITLES) | {"impulses"}

    def unmet(self, context: Station) -> str:
        """Nothing is needed."""
        return ""

    def check_options(self, options: Options) -> None:
        """`seconds`: of the untouched board."""
        self._seconds(options)

    def _seconds(self, options: Options) -> float:
        return options.take_number("seconds", 12.0, 2.0, 3600.0)

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Measure."""
        seconds = self._seconds(options)
        options.done()
        station = context
        capture = station.untouched(seconds, log)
        rate_hz = capture.rate_hz
        if len(capture) < FRAMES_MIN:
            few = f"gave {len(capture)} frames in {capture.seconds:.1f} s, and noise needs {FRAMES_MIN}"
            raise BoardError(station.address, f"{few}; give it more seconds in the plan")
        parts = noise_parts(station.kind, capture.raw_counts, rate_hz, station.status()["scan_time_us"] * 1e-6)
        for name in TITLES:
            log.measure(name, float(getattr(parts, name)), "counts")
        log.measure("impulses", parts.impulses_per_s, "1/s")
        limits = {name: limit.maximum for name in TITLES if (limit := log.limit(name)) and limit.maximum is not None}
        station.evidence.board += noise_faults(parts, limits)
        station.noise = parts
        self._pictures(station, parts, rate_hz, log)

    def _pictures(self, station: Station, parts: NoiseParts, rate_hz: float, log: PhaseLog) -> None:
        station.picture(
            log,
            "spectrum.png",
            lambda: spectrum(parts.frequency_hz, parts.spectrum, parts.white, rate_hz),
            "Spectrum of the untouched board",
        )
        station.picture(
            log,
            "noise.png",
            lambda: board_map(station.kind, parts.white_by_taxel, "white noise (counts)"),
            "White noise of each taxel",
        )
