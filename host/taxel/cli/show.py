"""`taxel show`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from taxel.campaign.pictures import save_clouds, save_grasp
from taxel.errors import TaxelError
from taxel.recording.grasp_dataset import GraspDataset


def show(
    datasets: Annotated[list[Path], typer.Argument(help="Grasp datasets, such as real.h5 sim.h5.")],
    out: Annotated[Path, typer.Option(help="Folder for clouds.png and grasp.png.")] = Path("out/show"),
    grasp: Annotated[
        str | None, typer.Option(help="Id of the grasp to draw. Default: the first one that all datasets contain.")
    ] = None,
) -> None:
    """Draw the contact points of a grasp dataset.

    One picture shows the accumulated contact points of each object, the other the active and inactive taxels of a
    grasp.

    Example: taxel show out/campaign/real.h5 out/campaign/sim.h5 --out out/show
    """
    console = Console(markup=False)
    common = _find_common_ids(datasets)
    if not common and grasp is None:
        raise TaxelError(
            f"{', '.join(map(str, datasets))}: the datasets have no grasp id in common; give one with --grasp"
        )
    out.mkdir(parents=True, exist_ok=True)
    with console.status("drawing"):
        save_clouds(datasets, out / "clouds.png")
        save_grasp(datasets, out / "grasp.png", common[0] if grasp is None else grasp)
    console.print(f"pictures: {out / 'clouds.png'}, {out / 'grasp.png'}")


def _find_common_ids(paths: list[Path]) -> list[str]:
    """List the ids of the grasps that all datasets contain, sorted. paths: grasp datasets."""
    ids: list[set[str]] = []
    for path in paths:
        with GraspDataset(path) as data:
            ids.append(set(data.ids))
    return sorted(set.intersection(*ids))
