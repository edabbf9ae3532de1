"""Releases of what decides the bytes of a shard."""

from __future__ import annotations

from importlib.metadata import version

import h5py  # type: ignore[import-untyped, unused-ignore]


def versions() -> dict[str, str]:
    """By name."""
    found = {name: version(name) for name in ("taxel", "mujoco", "numpy", "scipy", "h5py")}
    return {**found, "hdf5": str(h5py.version.hdf5_version)}
