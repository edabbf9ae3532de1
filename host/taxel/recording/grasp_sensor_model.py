"""The sensor model of a simulated dataset: how the simulator converted force into raw counts."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from taxel.recording.grasp_checks import Location, check_array, check_choice, check_number, find_first, format_index
from taxel.recording.grasp_format import LAYERS, ArraySpec
from taxel.recording.grasp_tables import copy_read_only
from taxel.types import CountArray, FloatArray, IntArray

LARGEST_COUNT = 65_535
"""Largest raw count: a count has 16 bits."""

REQUIRED = ("baseline_counts", "full_scale_drop_counts", "half_force_n")
OPTIONAL = ("noise_counts", "noise_line_counts", "contact_stiffness_n_per_m", "layer")


@dataclass(frozen=True, eq=False)
class SensorModel:
    """Raw count as a function of the contact force F.

    signal(F) = full_scale_drop_counts * F / (F + half_force_n); raw count = round(baseline_counts - signal + noise).

    baseline_counts: raw count without contact, one number or f64[n].
    full_scale_drop_counts: limit of the signal for large forces, counts.
    half_force_n: force with half of that signal, newtons, one number or f64[n]. The value of a taxel is proportional to
        the area of the square that the taxel measures.
    noise_counts, noise_line_counts: standard deviations, counts, of the noise of each taxel and of the noise that all
        taxels of an RX line share.
    contact_stiffness_n_per_m: stiffness of the dielectric under one taxel, N/m. layer: "coupled" if a pressed taxel
        also loads its neighbours through the layer, else "uncoupled".
    """

    baseline_counts: float | FloatArray
    full_scale_drop_counts: float
    half_force_n: float | FloatArray
    noise_counts: float = 0.0
    noise_line_counts: float = 0.0
    contact_stiffness_n_per_m: float | None = None
    layer: str | None = None

    def predict_signal(self, force: npt.ArrayLike) -> FloatArray:
        """Predict the signal without noise, counts below the baseline, in the shape of `force`.

        force: newtons, 0 or more, f64[..., n] if the half force differs between taxels.
        """
        newtons = np.asarray(force, np.float64)
        return np.asarray(self.full_scale_drop_counts * newtons / (newtons + self.half_force_n))

    def counts(self, force: npt.ArrayLike, generator: np.random.Generator, line: IntArray | None = None) -> CountArray:
        """Simulate raw counts u16[T, n] with noise, clipped to 16 bits, under forces f64[T, n], newtons.

        generator: source of the noise. line: i64[n], RX line of each taxel (`TaxelTable.rx_line`), required if
        noise_line_counts is not 0: all taxels of a line have the same line noise in a frame. Raises ValueError if line
        is required and None.
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


def check_sensor_model(values: Mapping[str, Any], location: Location, n: int) -> SensorModel:
    """Build the sensor model of a simulated dataset from its attributes; raises DatasetError for the first error.

    values: attributes by name; an absent or None value gets its default. n: number of taxels.
    """
    for name in REQUIRED:
        if values.get(name) is None:
            location.key(name).fail("a number", "nothing", "add the attribute")
    baseline, half_force = (
        _check_per_taxel(values[name], location.key(name), n) for name in ("baseline_counts", "half_force_n")
    )
    numbers = {"full_scale_drop_counts": check_number(values["full_scale_drop_counts"], location.key(REQUIRED[1]))}
    for name in ("noise_counts", "noise_line_counts"):
        if values.get(name) is not None:
            numbers[name] = check_number(values[name], location.key(name), allow_zero=True)
    stiffness, layer = values.get("contact_stiffness_n_per_m"), values.get("layer")
    if stiffness is not None:
        stiffness = check_number(stiffness, location.key("contact_stiffness_n_per_m"))
    if layer is not None:
        layer = check_choice(layer, LAYERS, location.key("layer"))
    return SensorModel(baseline, half_force_n=half_force, **numbers, contact_stiffness_n_per_m=stiffness, layer=layer)


def _check_per_taxel(value: Any, location: Location, n: int) -> float | FloatArray:
    """Return a parameter of a sensor model that may differ between taxels: one number, or f64[n], read-only.

    Raises DatasetError for a value of 0 or below, and for another shape.
    """
    if np.ndim(value) == 0:
        return check_number(value[()] if isinstance(value, np.ndarray) else value, location)
    if isinstance(value, np.ndarray) and value.dtype.kind in "ui":
        value = value.astype(np.float64)  # many programs store counts as integers
    numbers = copy_read_only(check_array(value, ArraySpec("f8", ("n",)), {"n": n}, location))
    if (numbers <= 0.0).any():
        at = find_first(numbers <= 0.0)
        location.fail("numbers above 0", f"{numbers[at]} at {format_index(at)}", "correct it")
    return numbers
