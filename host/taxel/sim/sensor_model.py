"""Raw counts of the simulated sensor: saturating signal of the force, white noise, and noise common to an RX line."""

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.types import CountArray, FloatArray, IndexArray

__all__ = ["FULL_SCALE_SIGNAL_COUNTS", "HALF_FORCE_N", "REST_COUNTS", "SensorModelError", "SimSensor"]

REST_COUNTS = 2426.0
"""Raw count without contact. Source: as `HALF_FORCE_N`."""
FULL_SCALE_SIGNAL_COUNTS = 1915.0
"""Limit of the signal for large forces, counts. Source: as `HALF_FORCE_N`."""
HALF_FORCE_N = 1.656
"""Force at half of the full-scale signal, newtons. The three parameters are fitted to indentations of single taxels of
the emulated skin with known forces of 0.05 to 5 N. Source: tools/sim/fit_sensor_model.py.
"""

NOISE_COUNTS = 4.0
"""Standard deviation of the white noise of one taxel, counts (chosen)."""

_MAX_COUNTS = np.iinfo(np.uint16).max


class SensorModelError(TaxelError, ValueError):
    """A parameter of the sensor model is out of range. field: its name. expected, found: strings for the message."""

    def __init__(self, field: str, expected: str, found: str) -> None:
        """Create the error for a parameter out of range; field: its name; expected, found: as text."""
        super().__init__(field, expected, found)
        self.field = field
        self.expected = expected
        self.found = found

    def _format_message(self) -> str:
        return f"sensor model: {self.field}: expected {self.expected}, found {self.found}; correct that number"


@dataclass(frozen=True)
class SimSensor:
    """The simulated sensor: raw = round(baseline - signal + noise).

    signal(F) = full_scale_drop_counts F / (F + half_force_n), the sensor model of the dataset format, for a taxel whose
    square has the reference area (`taxel.hand.Hand.area_share` is 1). The dielectric responds to pressure: the half
    force of another taxel is proportional to the area of its square. noise_counts:
    standard deviation of the white noise. noise_line_counts: standard deviation of the noise that is common to all
    taxels of one RX line of one board, which share an amplifier; independent between frames. Raises SensorModelError
    for a number out of range.
    """

    baseline_counts: float = REST_COUNTS
    full_scale_drop_counts: float = FULL_SCALE_SIGNAL_COUNTS
    half_force_n: float = HALF_FORCE_N
    noise_counts: float = NOISE_COUNTS
    noise_line_counts: float = 0.0

    def __post_init__(self) -> None:
        """Check each parameter of the simulated sensor: finite, above 0 (noise may be 0); raise SensorModelError."""
        for field, value in asdict(self).items():
            zero_allowed = field.startswith("noise")
            if not (np.isfinite(value) and (value > 0 or (zero_allowed and value == 0))):
                minimum = "of at least 0" if zero_allowed else "above 0"
                raise SensorModelError(field, f"a finite number {minimum}", str(value))
        if self.baseline_counts > _MAX_COUNTS:
            raise SensorModelError("baseline_counts", f"at most {_MAX_COUNTS}", str(self.baseline_counts))

    def make_dataset_model(
        self, hand: Hand, stiffness_n_per_m: float | None, layer: str | None = "uncoupled"
    ) -> SensorModel:
        """Return the sensor model that a dataset of this hand stores.

        stiffness_n_per_m: of the elastic layer over one taxel. layer: "coupled" or "uncoupled", its springs. None: the
        dataset does not state the value.
        """
        half_force = self.half_force_n * hand.area_share
        return SensorModel(
            self.baseline_counts,
            self.full_scale_drop_counts,
            float(half_force[0]) if (half_force == half_force[0]).all() else half_force,
            self.noise_counts,
            self.noise_line_counts,
            stiffness_n_per_m,
            layer,
        )

    def predict_signal(self, force_n: npt.ArrayLike, area_share: FloatArray | float = 1.0) -> FloatArray:
        """Predict the signal, counts below the baseline, f64[...], under forces f64[...] of at least 0 newtons.

        area_share: area of the taxels' squares relative to the reference area, a number, or f64[n] for forces
        f64[..., n].
        """
        force = np.asarray(force_n, dtype=np.float64)
        return np.asarray(self.full_scale_drop_counts * force / (force + self.half_force_n * area_share))

    def raw_counts(self, hand: Hand, force_n: npt.ArrayLike, generator: np.random.Generator) -> CountArray:
        """Simulate raw counts u16[T, n] under contact forces f64[T, n], newtons; `generator` supplies the noise.

        Raises ValueError for forces of another shape, negative or not finite.
        """
        force = np.asarray(force_n, dtype=np.float64)
        if force.ndim != 2 or force.shape[1] != hand.n_taxels:
            raise ValueError(f"force_n: expected [T, {hand.n_taxels}], found {force.shape}")
        if not np.isfinite(force).all() or (force < 0).any():
            raise ValueError(
                "force_n: expected finite forces of at least 0, found a negative force, a NaN or an infinity"
            )
        counts = self.baseline_counts - self.predict_signal(force, hand.area_share)
        if self.noise_counts:
            counts += generator.normal(scale=self.noise_counts, size=force.shape)
        if self.noise_line_counts:  # all taxels of an RX line share this noise
            line = _number_rx_lines(hand)
            shared = generator.normal(scale=self.noise_line_counts, size=(len(force), line.max() + 1))
            counts += shared[:, line]
        return np.clip(np.rint(counts), 0, _MAX_COUNTS).astype(np.uint16)

    def attributes(self) -> dict[str, float]:
        """Return the parameters by name, as a dataset stores them in the attributes of its HDF5 group /sensor_model."""
        return asdict(self)


def _number_rx_lines(hand: Hand) -> IndexArray:
    """Return the number of each taxel's RX line, int[n]; the RX lines of all boards are numbered consecutively."""
    _, line = np.unique(hand.board_index * 256 + hand.rx, return_inverse=True)
    return np.asarray(line, dtype=np.intp)
