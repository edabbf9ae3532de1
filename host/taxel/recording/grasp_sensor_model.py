"""How a simulator turned force into counts, as its dataset states it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from taxel.recording.grasp_checks import Place, check_choice, check_number, first, given, shown_index
from taxel.recording.grasp_format import LAYERS, ArraySpec
from taxel.recording.grasp_tables import frozen

LARGEST_COUNT = 65_535
"""A raw count is 16 bit."""

REQUIRED = ("baseline_counts", "full_scale_drop_counts", "half_force_n")
OPTIONAL = ("noise_counts", "noise_line_counts", "contact_stiffness_n_per_m", "layer")


@dataclass(frozen=True, eq=False)
class SensorModel:
    """Force to counts: signal(F) = full_scale_drop_counts * F / (F + half_force_n).

    raw = round(baseline - signal + noise).

    baseline_counts: one number or f64[n], without contact.
    full_scale_drop_counts: the signal that an endless force would reach.
    half_force_n: the force of half that signal, newtons.
    noise_counts, noise_line_counts: standard deviations; each taxel's own, and common to the taxels of an RX line.
    contact_stiffness_n_per_m: of the dielectric under one taxel. layer: "uncoupled" or "coupled".
    """

    baseline_counts: float | NDArray[np.float64]
    full_scale_drop_counts: float
    half_force_n: float
    noise_counts: float = 0.0
    noise_line_counts: float = 0.0
    contact_stiffness_n_per_m: float | None = None
    layer: str | None = None

    def predict_signal(self, force: npt.ArrayLike) -> NDArray[np.float64]:
        """f64 of the shape of force, counts. force: newtons, 0 or more."""
        newtons = np.asarray(force, np.float64)
        return np.asarray(self.full_scale_drop_counts * newtons / (newtons + self.half_force_n))

    def counts(
        self, force: npt.ArrayLike, generator: np.random.Generator, line: NDArray[np.int64] | None = None
    ) -> NDArray[np.uint16]:
        """u16[T, n], what the boards would send; clipped to 16 bit.

        force: f64[T, n], newtons. generator: of the noise. line: i64[n], `TaxelTable.rx_line`, needed where
        noise_line_counts is not 0: the noise of a line is drawn once a frame for all its taxels.

        Raises ValueError where line is needed and missing.
        """
        exact = self.baseline_counts - self.predict_signal(force)
        if self.noise_counts:
            exact = exact + generator.normal(0.0, self.noise_counts, exact.shape)
        if self.noise_line_counts:
            if line is None:
                raise ValueError("line: expected the line of each taxel (TaxelTable.rx_line), found None")
            shared = generator.normal(0.0, self.noise_line_counts, (*exact.shape[:-1], int(line.max()) + 1))
            exact = exact + shared[..., line]
        return np.clip(np.rint(exact), 0, LARGEST_COUNT).astype(np.uint16)


def checked_sensor_model(values: Mapping[str, Any], place: Place, n: int) -> SensorModel:
    """The model of its attributes; raises DatasetError for the first mistake.

    values: attributes by name; what is absent or None takes its default. n: number of taxels.
    """
    for name in REQUIRED:
        if values.get(name) is None:
            place.key(name).fail("a number", "nothing", "add the attribute")
    baseline = _baseline(values["baseline_counts"], place.key("baseline_counts"), n)
    numbers = {name: check_number(values[name], place.key(name)) for name in REQUIRED[1:]}
    for name in ("noise_counts", "noise_line_counts"):
        if values.get(name) is not None:
            numbers[name] = check_number(values[name], place.key(name), zero=True)
    stiffness, layer = values.get("contact_stiffness_n_per_m"), values.get("layer")
    if stiffness is not None:
        stiffness = check_number(stiffness, place.key("contact_stiffness_n_per_m"))
    if layer is not None:
        layer = check_choice(layer, LAYERS, place.key("layer"))
    return SensorModel(baseline, **numbers, contact_stiffness_n_per_m=stiffness, layer=layer)


def _baseline(value: Any, place: Place, n: int) -> float | NDArray[np.float64]:
    if np.ndim(value) == 0:
        return check_number(value[()] if isinstance(value, np.ndarray) else value, place)
    if isinstance(value, np.ndarray) and value.dtype.kind in "ui":
        value = value.astype(np.float64)  # counts are whole numbers to many programs
    counts = frozen(given(value, ArraySpec("f8", ("n",)), {"n": n}, place))
    if (counts <= 0.0).any():
        at = first(counts <= 0.0)
        place.fail("counts above 0", f"{counts[at]} at {shown_index(at)}", "correct it")
    return counts
