"""Every taxel is pressed by itself."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.signal import ACTIVATION_THRESHOLD_COUNTS, snr
from taxel_tools.bench.analysis.fault import BOARD, Fault
from taxel_tools.bench.analysis.presses import Presses, crosstalk, gain_fault, press_faults
from taxel_tools.bench.pictures import board_map
from taxel_tools.bench.probe import NoProbe
from taxel_tools.bench.station import Station
from taxel_tools.testing.engine import PhaseLog
from taxel_tools.testing.options import Options

LEAST_SHARE: Final = 0.4
SETTLE_FRAMES: Final = 3
"""Thrown away after each change: a frame may have been scanned before it."""
MANUAL_S: Final = 3.0
"""How long after a person's word the counts may take to show it."""
MANUAL_ATTEMPTS: Final = 2
"""A person may have pressed beside the taxel; who answers elsewhere twice has exchanged lines."""
QUANTISATION_COUNTS: Final = 0.3
"""Standard deviation of a count's rounding: no taxel has less noise."""


class PressEach:
    """A map of who answers to what: response, dead taxels, order of lines, SNR, crosstalk."""

    name = "presses"
    title = "Each taxel pressed"
    automatic = False
    limit_names = frozenset({"response", "weakest", "snr", "lowest_snr", "crosstalk"})

    def unmet(self, context: Station) -> str:
        """A probe is needed."""
        return "no probe: give --probe" if isinstance(context.probe, NoProbe) else ""

    def check_options(self, options: Options) -> None:
        """`force_n`, `diameter_mm` of the probe; `frames` for each mean."""
        self._options(options)

    def _options(self, options: Options) -> tuple[float, float, int]:
        return (
            options.take_number("force_n", 1.0, 0.01, 50.0),
            options.take_number("diameter_mm", 3.0, 0.5, 20.0) * 1e-3,
            options.take_whole("frames", 6, 1, 1000),
        )

    def run(self, context: Station, options: Options, log: PhaseLog) -> None:
        """Press, let go, next."""
        force_n, diameter_m, frames = self._options(options)
        options.done()
        station = context
        noise = station.noise.white_by_taxel if station.noise else station.untouched(1.0, log).raw_counts.std(axis=0)
        sigma = np.maximum(noise, QUANTISATION_COUNTS)
        try:
            response = self._map(station, force_n, diameter_m, frames, log)
        finally:
            station.probe.release()
        error = sigma * np.sqrt(2.0 / frames)
        presses = Presses(station.kind, response, error, force_n if station.probe.knows_force else float("nan"))
        self._judge(station, presses, sigma, log)

    def _map(
        self, station: Station, force_n: float, diameter_m: float, frames: int, log: PhaseLog
    ) -> NDArray[np.float64]:
        count = station.kind.taxel_count
        response = np.full((count, count), np.nan)
        for taxel in range(count):
            rest = station.frames(frames).mean
            if station.probe.is_automatic:
                station.probe.press(taxel, force_n, diameter_m)
            else:
                _press_by_hand(station, taxel, force_n, diameter_m, rest)
            response[taxel] = rest - station.frames(frames, SETTLE_FRAMES).mean
            station.probe.release()
            if station.probe.is_automatic:
                station.frames(1, SETTLE_FRAMES - 1)
            else:
                _signal_by_hand(station, rest, pressed=False)
            log.progress((taxel + 1) / count)
        return response

    def _judge(self, station: Station, presses: Presses, sigma: NDArray[np.float64], log: PhaseLog) -> None:
        limit = log.limit("weakest")
        least = limit.minimum if limit is not None and limit.minimum is not None else LEAST_SHARE
        usual = presses.usual
        faults = press_faults(presses, least)
        station.evidence.pressed = faults
        explained = station.faulty()
        log.measure("weakest", float(np.min(presses.own)) / usual if presses.answers else None, "of the median")
        if np.isfinite(presses.force_n):
            log.measure("response", presses.usual_of(~explained), "counts")
            ratio = snr(presses.own, sigma)
            sound = ratio[~explained] if not explained.all() else ratio
            log.measure("snr", float(np.median(sound)), "")
            log.measure("lowest_snr", float(np.min(sound)), "")
        if presses.answers:
            station.evidence.pressed = [*faults, *self._board_faults(presses, explained, log)]
        station.picture(
            log,
            "presses.png",
            lambda: board_map(station.kind, presses.own, "signal when pressed (counts)", explained),
            "What each taxel answers to a press on it; faults are framed",
        )

    def _board_faults(self, presses: Presses, explained: NDArray[np.bool_], log: PhaseLog) -> list[Fault]:
        """Gain and crosstalk."""
        faults: list[Fault] = []
        limit = log.limit("response")
        if limit is not None:
            gain = gain_fault(presses, presses.usual_of(~explained), *limit.bounds)
            faults += [gain] if gain else []
        limit = log.limit("crosstalk")
        found = crosstalk(presses, explained)
        for talk in found:
            log.measure("crosstalk", abs(talk.share), "of the response", talk.where)
        beyond = [talk for talk in found if limit is not None and not limit.holds(abs(talk.share)) and talk.is_sure]
        if limit is not None and beyond:
            share, sign = abs(beyond[0].share), " with the other sign" if beyond[0].share < 0.0 else ""
            seen = f"{share:.1%} of a press shows {beyond[0].where}{sign}, {limit} is allowed"
            severity = limit.severity(share)
            faults.append(Fault("crosstalk", BOARD, f"{seen}: look for flux between traces", severity))
        return faults


def _press_by_hand(station: Station, taxel: int, force_n: float, diameter_m: float, rest: NDArray[np.float64]) -> None:
    """Ask for a press until that taxel answers most, or has been asked for often enough."""
    for _ in range(MANUAL_ATTEMPTS):
        station.probe.release()
        station.probe.press(taxel, force_n, diameter_m)
        if int(np.argmax(_signal_by_hand(station, rest, pressed=True))) == taxel:
            return


def _signal_by_hand(station: Station, rest: NDArray[np.float64], *, pressed: bool) -> NDArray[np.float64]:
    """Wait until a taxel answers, or none does any more, but not for ever; the signal then, f64[taxels]."""
    began = station.wire.now_s()
    while True:
        signal = np.asarray(rest - station.frames(2).mean)
        if (signal.max() > ACTIVATION_THRESHOLD_COUNTS) == pressed or station.wire.now_s() - began > MANUAL_S:
            return signal
