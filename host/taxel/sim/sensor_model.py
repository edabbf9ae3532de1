"""From force to raw counts: a saturating signal, white noise, and noise common to an RX line."""

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.types import FloatArray

__all__ = ["FULL_SCALE_SIGNAL_COUNTS", "HALF_FORCE_N", "REST_COUNTS", "SensorModelError", "SimSensor"]

REST_COUNTS = 2426.0
FULL_SCALE_SIGNAL_COUNTS = 1915.0
HALF_FORCE_N = 1.656
"""What an experimenter finds who presses single taxels of the emulated skin with known forces and fits the form to 0.05
to 5 N. Source: tools/sim/fit_sensor_model.py."""

NOISE_COUNTS = 4.0

_LARGEST = np.iinfo(np.uint16).max


class SensorModelError(TaxelError, ValueError):
    """A number of the sensor model that makes no sense. Attributes: field, expected, found."""

    def __init__(self, field: str, expected: str, found: str) -> None:
        super().__init__(field, expected, found)
        self.field = field
        self.expected = expected
        self.found = found

    def __str__(self) -> str:
        return f"sensor model: {self.field}: expected {self.expected}, found {self.found}; correct that number"


@dataclass(frozen=True)
class SimSensor:
    """The simulator's sensor: raw = round(baseline - signal + noise), with the signal of the dataset's sensor model.

    signal(F) = full_scale_drop_counts F / (F + half_force_n); all taxels are alike. noise_counts: standard deviation of
    white noise. noise_line_counts: of noise that all taxels of one RX line of one board share in one frame, as they
    share its amplifier; every frame is drawn anew. Raises SensorModelError for a number out of range.
    """

    baseline_counts: float = REST_COUNTS
    full_scale_drop_counts: float = FULL_SCALE_SIGNAL_COUNTS
    half_force_n: float = HALF_FORCE_N
    noise_counts: float = NOISE_COUNTS
    noise_line_counts: float = 0.0

    def __post_init__(self) -> None:
        for field, value in asdict(self).items():
            zero_allowed = field.startswith("noise")
            if not (np.isfinite(value) and (value > 0 or (zero_allowed and value == 0))):
                least = "of at least 0" if zero_allowed else "above 0"
                raise SensorModelError(field, f"a finite number {least}", str(value))
        if self.baseline_counts > _LARGEST:
            raise SensorModelError("baseline_counts", f"at most {_LARGEST}", str(self.baseline_counts))

    def told(self, stiffness_n_per_m: float, layer: str = "uncoupled") -> SensorModel:
        """What a dataset says of it. The other two: of the elastic layer, for one taxel, newtons a metre."""
        return SensorModel(
            self.baseline_counts,
            self.full_scale_drop_counts,
            self.half_force_n,
            self.noise_counts,
            self.noise_line_counts,
            stiffness_n_per_m,
            layer,
        )

    def predict_signal(self, force_n: npt.ArrayLike) -> FloatArray:
        """Signal f64[...], counts below the baseline, under forces f64[...] of at least 0 newtons."""
        force = np.asarray(force_n, dtype=np.float64)
        return np.asarray(self.full_scale_drop_counts * force / (force + self.half_force_n))

    def force_for(self, signal_counts: float) -> float:
        """The force, newtons, that makes such a signal; infinite from the full scale on."""
        left = self.full_scale_drop_counts - signal_counts
        return self.half_force_n * signal_counts / left if left > 0 else float("inf")

    def raw_counts(self, hand: Hand, force_n: npt.ArrayLike, generator: np.random.Generator) -> npt.NDArray[np.uint16]:
        """Raw counts u16[T, n] under contact forces f64[T, n], newtons.

        Noise comes from `generator`: the same seed gives the same counts. Raises ValueError for forces of another
        shape, negative or not finite.
        """
        force = np.asarray(force_n, dtype=np.float64)
        if force.ndim != 2 or force.shape[1] != hand.n_taxels:
            raise ValueError(f"force_n: expected [T, {hand.n_taxels}], found {force.shape}")
        if not np.isfinite(force).all() or (force < 0).any():
            raise ValueError("force_n: expected finite forces of at least 0, found others")
        counts = self.baseline_counts - self.predict_signal(force)
        if self.noise_counts:
            counts += generator.normal(scale=self.noise_counts, size=force.shape)
        if self.noise_line_counts:
            line = _rx_lines(hand)
            shared = generator.normal(scale=self.noise_line_counts, size=(len(force), line.max() + 1))
            counts += shared[:, line]
        return np.clip(np.rint(counts), 0, _LARGEST).astype(np.uint16)

    def attributes(self) -> dict[str, float]:
        """What a dataset's /sensor_model says of this sensor."""
        return asdict(self)


def _rx_lines(hand: Hand) -> npt.NDArray[np.intp]:
    """The RX line of each taxel, counted over all boards, [n]."""
    _, line = np.unique(hand.board_index * 256 + hand.rx, return_inverse=True)
    return np.asarray(line, dtype=np.intp)
