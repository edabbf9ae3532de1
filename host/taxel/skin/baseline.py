"""Measurement of the baseline from the scans of a skin."""

from collections.abc import Callable, Iterable

from taxel.errors import TaxelError
from taxel.signal import Baseline, BaselineResult
from taxel.skin.frame import SkinFrame


def measure_baseline(
    n_taxels: int, scans: Iterable[SkinFrame], samples: int, progress: Callable[[float], None] | None, name: str
) -> BaselineResult:
    """Return the baseline (mean, noise, disturbed taxels) over `samples` frames of all responding boards.

    scans: consumed up to the end of the measurement. progress: called with the completed share, 0 to 1. name: name of
    the link in error messages. If some boards have not delivered `samples` frames after twice as many scans, their
    taxels are NaN. Raises `TaxelError` if the scans end before the measurement.
    """
    baseline = Baseline(n_taxels, samples=samples)
    cycles = 0
    for scan in scans:
        cycles += 1
        baseline.update(scan.raw_counts, scan.valid)
        if progress is not None:
            progress(baseline.progress)
        if baseline.is_ready:
            return baseline.result()
        if cycles >= 2 * samples and baseline.ready_mask.any():
            return BaselineResult(baseline.mean, baseline.noise, baseline.disturbed, baseline.count)
    raise TaxelError(f"{name}: the recording ended after {cycles} scans; a baseline needs {samples}")
