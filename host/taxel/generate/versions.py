"""Releases of the libraries that affect the bytes of a shard."""

from importlib.metadata import version

import h5py  # type: ignore[import-untyped, unused-ignore]


def list_package_versions() -> dict[str, str]:
    """Releases by name."""
    releases = {name: version(name) for name in ("taxel", "mujoco", "numpy", "scipy", "h5py")}
    return {**releases, "hdf5": str(h5py.version.hdf5_version)}
