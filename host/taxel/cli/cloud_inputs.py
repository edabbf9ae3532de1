"""Arguments that the commands of `taxel cloud` share, and the objects that they name."""

from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from taxel.cloud.contact_cloud import ContactCloud, require_points
from taxel.cloud.files import has_triangles, read_cloud
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import get_builtin_models, load_model
from taxel.errors import TaxelError

CloudFile = Annotated[Path, typer.Argument(help="Cloud file: PLY, PCD or XYZ, in metres.", metavar="CLOUD")]
Target = Annotated[
    str,
    typer.Argument(
        help="Mesh (STL, OBJ, PLY), cloud (PLY, PCD, XYZ) or shape: " + ", ".join(get_builtin_models()) + ".",
        metavar="MESH|CLOUD|SHAPE",
    ),
]
Out = Annotated[Path, typer.Option(help="File to write: .ply, .pcd or .xyz.")]
Unit = Annotated[str, typer.Option(help="Unit of mesh files: m, cm, mm or in.")]
Anywhere = Annotated[
    bool,
    typer.Option("--anywhere", help="Align from any initial pose. Default: the cloud is in the frame of the target."),
]

UNITS: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}

LARGEST_SIZE_RATIO: Final = 50.0
"""Ratio of the sizes of mesh and cloud, or its inverse, above which the mesh is assumed to be in another unit.

The units differ by factors of 10 to 1000; a cloud covers at least a few per cent of its object.
"""


def metres(unit: str) -> float:
    """Return the length of a unit, such as "mm", in metres. Raises `TaxelError` for an unknown unit."""
    if unit not in UNITS:
        raise TaxelError(f"--unit: expected one of {', '.join(UNITS)}, found {unit!r}")
    return UNITS[unit]


def require_nonempty(cloud: ContactCloud) -> None:
    """Raise a one-line error for a contact cloud without points."""
    require_points(cloud.points, cloud.name)


def load_target(name: str, unit: str) -> TriangleMesh | ContactCloud:
    """Load the target of a distance or an alignment: a built-in shape by its name, or the mesh or cloud of a file.

    unit: length unit of a mesh file. Raises `MeshError`, `CloudFileError`, `OSError`.
    """
    scale = metres(unit)
    if name in get_builtin_models() or not Path(name).exists() or has_triangles(name):
        return load_model(name, scale)
    cloud = read_cloud(name)
    require_nonempty(cloud)
    return cloud


def check_scale(cloud: ContactCloud, mesh: TriangleMesh) -> None:
    """Raise `TaxelError` if the sizes of mesh and cloud differ by more than `LARGEST_SIZE_RATIO`.

    The unit of the mesh file is then probably wrong, for example millimetres instead of metres.
    """
    extent = float(np.linalg.norm(np.ptp(cloud.points, axis=0)))
    if extent > 0.0 and not 1.0 / LARGEST_SIZE_RATIO < mesh.size / extent < LARGEST_SIZE_RATIO:
        sizes = f"mesh {mesh.size:.3g} m, cloud {extent:.3g} m"
        raise TaxelError(
            f"{mesh.name}: expected a mesh of about the size of the cloud, found {sizes}; "
            "give the unit of the mesh with --unit"
        )
