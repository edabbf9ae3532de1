"""Figures 5.3, 5.6 to 5.14 and I-2 to I-6 of the thesis from the reproduced results, as PNG files.

Numbers that the thesis prints are shown in pale colours. Figure I-1 of the thesis is the same as Figure 5.11.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from taxel.output.figure import save_figure
from taxel.thesis import cloud_figures, result_charts
from taxel.thesis.matching import ObjectClouds
from taxel.thesis.object_result import ObjectResult

FIGURES: Final = {
    "5.3": "Contact clouds of one grasp of the cylinder, active and inactive taxels",
    "5.6": "Accumulated clouds before any treatment",
    "5.7": "Clouds on their CAD models",
    "5.8": "Real on simulated clouds",
    "5.9": "Number of points at each step of the treatment",
    "5.10": "Force filter: distances to the CAD models",
    "5.11": "Clouds of the rectangular prism at each stage of the treatment",
    "5.12": "Distances between real and simulated clouds, step by step",
    "5.13": "Share of each step in the decrease of the mean distance",
    "5.14": "Treated clouds on all CAD models",
    "I-2": "Clouds of the cylinder at each stage of the treatment",
    "I-3": "Clouds of the triangular prism at each stage of the treatment",
    "I-4": "Share of each step in the decrease of mean and RMS, rectangular prism",
    "I-5": "Share of each step in the decrease of mean and RMS, cylinder",
    "I-6": "Share of each step in the decrease of mean and RMS, triangular prism",
}


def save_figures(items: Sequence[ObjectClouds], results: Sequence[ObjectResult], out: Path) -> dict[str, Path]:
    """Draw all figures of the reproduction to the folder `out`; return their files by figure number.

    items, results: clouds and distances of each object, in the order of the thesis.
    """
    by_name = {item.printed_name: item for item in items}
    figures = {
        "5.3": cloud_figures.draw_grasp(by_name["cylindrical"]),
        "5.6": cloud_figures.draw_accumulated(items),
        "5.7": cloud_figures.draw_on_cad(items),
        "5.8": cloud_figures.draw_on_sim(items),
        "5.9": result_charts.draw_treatment(results),
        "5.10": result_charts.draw_force_filter(results),
        "5.11": cloud_figures.draw_progress(items[0]),
        "5.12": result_charts.draw_stages(results),
        "5.13": result_charts.draw_shares(results),
        "5.14": result_charts.draw_cross_match(results),
        "I-2": cloud_figures.draw_progress(by_name["cylindrical"]),
        "I-3": cloud_figures.draw_progress(by_name["triangular"]),
        **{f"I-{number}": result_charts.draw_object_shares(result) for number, result in enumerate(results, 4)},
    }
    for number, figure in figures.items():
        save_figure(figure, out / _name_file(number), dpi=110, facecolor="white")
    return find_figures(out)


def find_figures(folder: Path) -> dict[str, Path]:
    """Return the existing figure files in a folder by figure number, in the order of the thesis."""
    return {number: path for number in FIGURES if (path := folder / _name_file(number)).exists()}


def _name_file(number: str) -> str:
    """Return the file name of a figure."""
    return f"figure_{number.replace('.', '_').replace('-', '_')}.png"
