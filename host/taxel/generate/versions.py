"""Releases of the libraries that affect the bytes of a shard."""

from importlib.metadata import version

import h5py  # type: ignore[import-untyped, unused-ignore]


def list_package_versions() -> dict[str, str]:
    """List the installed releases of the packages that affect the bytes of a shard, by name of the package."""
    releases = {name: version(name) for name in ("taxel", "mujoco", "numpy", "scipy", "h5py")}
    return {**releases, "hdf5": str(h5py.version.hdf5_version)}
