"""What the commands of `taxel cloud` share: arguments, and what a name on the command line stands for."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from taxel.cloud.contact_cloud import ContactCloud, require_points
from taxel.cloud.files import holds_mesh, read_cloud
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import model, models
from taxel.errors import TaxelError

CloudFile = Annotated[Path, typer.Argument(help="A cloud: PLY, PCD or XYZ, metres.", metavar="CLOUD")]
Target = Annotated[
    str,
    typer.Argument(
        help="A mesh (STL, OBJ, PLY), a cloud (PLY, PCD, XYZ), or a shape: " + ", ".join(models()) + ".",
        metavar="MESH|CLOUD|SHAPE",
    ),
]
Out = Annotated[Path, typer.Option(help="The file to write: .ply, .pcd or .xyz.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what is there.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print as JSON, in metres.")]
Unit = Annotated[str, typer.Option(help="Of mesh files: m, cm, mm or in.")]
Anywhere = Annotated[
    bool, typer.Option("--anywhere", help="The cloud may lie and be turned in any way; else: in the target's frame.")
]

UNITS: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}

MOST_APART: Final = 50.0
"""Times; a mesh that is so much larger or smaller than a cloud is in another unit."""


def metres(unit: str) -> float:
    """Metres in a unit. Raises TaxelError for an unknown one."""
    if unit not in UNITS:
        raise TaxelError(f"--unit: expected one of {', '.join(UNITS)}, found {unit!r}; correct it")
    return UNITS[unit]


def only_points(cloud: ContactCloud) -> None:
    """Refuse an empty cloud."""
    require_points(cloud.points, cloud.name)


def target_of(name: str, unit: str) -> TriangleMesh | ContactCloud:
    """A built-in shape, a mesh file or a cloud file, by what it holds. Raises MeshError, CloudFileError, OSError."""
    scale = metres(unit)
    if name in models() or not Path(name).exists() or holds_mesh(name):
        return model(name, scale)
    cloud = read_cloud(name)
    only_points(cloud)
    return cloud


def check_scale(cloud: ContactCloud, mesh: TriangleMesh) -> None:
    """Refuse a mesh in another unit than the cloud."""
    extent = float(np.linalg.norm(np.ptp(cloud.points, axis=0)))
    if extent > 0.0 and not 1.0 / MOST_APART < mesh.size / extent < MOST_APART:
        found = f"{mesh.size:.3g} m across for a cloud of {extent:.3g} m"
        raise TaxelError(f"{mesh.name}: expected a mesh about as large as the cloud, found {found}; give its --unit")
