"""Imports of optional libraries, with one error text for all of them.

The core of the package needs numpy, pyserial, construct, typer and rich. Every other library belongs to an extra, which
`pip` installs: ``pip install 'taxel[sim]'``. A module that needs such a library imports it inside `optional_import`.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from types import MappingProxyType
from typing import Final

from taxel.errors import TaxelError

EXTRA_OF_PACKAGE: Final = MappingProxyType(
    {
        "can": "hand",
        "cryptography": "sign",
        "distributed": "cluster",
        "h5py": "gap",
        "igl": "cloud",
        "jinja2": "gap",
        "lz4": "ros",
        "matplotlib": "plots",
        "mcap": "ros",
        "msgpack": "hand",
        "mujoco": "sim",
        "pyarrow": "parquet",
        "rosbags": "ros",
        "rtde_control": "hand",
        "rtde_receive": "hand",
        "scipy": "gap",
        "small_gicp": "cloud",
        "smbus2": "i2c",
        "threadpoolctl": "gap",
        "viser": "web",
        "zarr": "parquet",
        "zstandard": "ros",
    }
)
"""Extra of pyproject.toml that installs an optional library, by the library's import name. Of several extras that
install a library, the smallest one is named.
"""


class MissingPackageError(TaxelError, ImportError):
    """An optional library is not installed.

    The message names the library, the extra (optional dependency group) and the command that installs it. package:
    import name of the library.
    """

    def __init__(self, purpose: str, package: str, extra: str) -> None:
        """Create the error of an optional package that is not installed.

        purpose: what needs the package, the subject of the message, such as "a grasp dataset (.h5)". extra: name of the
        optional dependency group that installs the package.
        """
        self.package = package
        super().__init__(
            f"{purpose} needs the Python package '{package}', which is not installed; "
            f"install the extra '{extra}': pip install 'taxel[{extra}]'"
        )


@contextmanager
def optional_import(package: str, purpose: str) -> Iterator[None]:
    """Context manager that converts an ImportError inside the block to a one-line `MissingPackageError`.

    package: a key of `EXTRA_OF_PACKAGE`. purpose: subject of the message, such as "a grasp dataset (.h5)".
    """
    try:
        yield
    except MissingPackageError:
        raise
    except ImportError:
        raise MissingPackageError(purpose, package, EXTRA_OF_PACKAGE[package]) from None


def require_packages(purpose: str, extra: str, *packages: str) -> None:
    """Raise `MissingPackageError` if one of the packages is not installed, before a task that imports them late.

    purpose: subject of the message, such as "taxel twin". extra: optional dependency group that installs the packages.
    """
    for package in packages:
        if find_spec(package) is None:
            raise MissingPackageError(purpose, package, extra)


def missing_package(error: ImportError, purpose: str, extra: str | None = None) -> MissingPackageError | None:
    """Return the error to show instead of a failed import; None if the missing module is not an optional library.

    purpose: subject of the message, such as "taxel twin". extra: optional dependency group that installs all that the
    purpose needs; None: the group that installs the missing library.
    """
    package = error.package if isinstance(error, MissingPackageError) else (error.name or "").partition(".")[0]
    if package not in EXTRA_OF_PACKAGE:
        return None
    return MissingPackageError(purpose, package, extra or EXTRA_OF_PACKAGE[package])
