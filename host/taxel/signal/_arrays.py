"""Checks of inputs: raw counts, validity masks and positive parameters."""

import math

import numpy as np
import numpy.typing as npt

from taxel.types import BoolArray, CountArray

RAW_COUNT_MAX = 65_535  # a raw count is an unsigned 16-bit number


def to_raw_count_array(raw_counts: npt.ArrayLike, ndim: int, n_taxels: int | None = None) -> CountArray:
    """Convert raw counts to u16 with `ndim` axes, [n] or [T, n], and `n_taxels` columns (None: any number).

    Raises ValueError for another shape, numbers that are not integers, and counts outside 0..65,535.
    """
    raw = np.asarray(raw_counts)
    check_shape("raw_counts", raw, (ndim,), n_taxels)
    if raw.dtype == np.uint16:
        return raw
    if raw.dtype.kind not in "iu":
        raise ValueError(f"raw_counts: expected integers 0..{RAW_COUNT_MAX}, found dtype {raw.dtype}")
    if raw.size and (raw.min() < 0 or raw.max() > RAW_COUNT_MAX):
        raise ValueError(f"raw_counts: expected 0..{RAW_COUNT_MAX}, found {raw.min()}..{raw.max()}")
    return raw.astype(np.uint16)


def check_shape(name: str, array: npt.NDArray[np.generic], ndims: tuple[int, ...], n_taxels: int | None) -> None:
    """Raise ValueError unless `array` has one of `ndims` axes and `n_taxels` columns (None: at least one)."""
    if array.ndim not in ndims:
        shapes = " or ".join("[n]" if ndim == 1 else "[T, n]" for ndim in ndims)
        raise ValueError(f"{name}: expected shape {shapes}, found {array.shape}")
    if array.shape[-1] == 0 or (n_taxels is not None and array.shape[-1] != n_taxels):
        expected = "at least 1 taxel" if n_taxels is None else f"{n_taxels} taxels"
        raise ValueError(f"{name}: expected {expected} in the last axis, found shape {array.shape}")


def to_validity_mask(valid: npt.ArrayLike | None, shape: tuple[int, ...]) -> BoolArray:
    """Return `valid` expanded to a bool array of the given shape; None: all entries are valid.

    For the shape [n], `valid` is None, a bool or bool[n]. For the shape [T, n], `valid` is None, a bool, bool[T] (whole
    frames) or bool[T, n]. Raises ValueError for another dtype or shape.
    """
    if valid is None:
        return np.ones(shape, dtype=np.bool_)
    mask = np.asarray(valid)
    if mask.dtype != np.bool_:
        raise ValueError(f"valid: expected bool, found dtype {mask.dtype}")
    if len(shape) == 2 and mask.shape == shape[:1]:
        mask = mask[:, np.newaxis]
    elif mask.shape not in ((), shape):
        per_frame = f", ({shape[0]},)" if len(shape) == 2 else ""
        raise ValueError(f"valid: expected a bool{per_frame} or {shape}, found shape {mask.shape}")
    return np.broadcast_to(mask, shape)


def check_positive(name: str, value: float) -> float:
    """Return `value` as a float; raise ValueError unless it is finite and above 0."""
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name}: expected a finite number above 0, found {value}")
    return float(value)
