"""`taxel show`: pictures of grasp datasets."""

from __future__ import annotations

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
    grasp: Annotated[str, typer.Option(help="Id of the grasp to draw; empty: the first that all datasets have.")] = "",
) -> None:
    """Draw each object's accumulated contact points, and one grasp with active and inactive taxels.

    Example: taxel show out/campaign/real.h5 out/campaign/sim.h5 --out out/show
    """
    console = Console(markup=False)
    common = _common(datasets)
    if not common and not grasp:
        raise TaxelError(f"{', '.join(map(str, datasets))}: no grasp id that all of them have; name one with --grasp")
    out.mkdir(parents=True, exist_ok=True)
    with console.status("drawing"):
        save_clouds(datasets, out / "clouds.png")
        save_grasp(datasets, out / "grasp.png", grasp or common[0])
    console.print(f"pictures: {out / 'clouds.png'}, {out / 'grasp.png'}")


def _common(paths: list[Path]) -> list[str]:
    ids: list[set[str]] = []
    for path in paths:
        with GraspDataset(path) as data:
            ids.append(set(data.ids))
    return sorted(set.intersection(*ids))
