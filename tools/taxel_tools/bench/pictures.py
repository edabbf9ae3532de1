"""Pictures of a test report, as PNG bytes.

matplotlib is imported only when a picture is drawn, so that the commands of boards start without the extra `plots`.
"""

import io
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from taxel.hand import BoardKind
from taxel.optional import optional_import
from taxel.types import BoolArray, FloatArray
from taxel_tools.bench.analysis.curve import Curve

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

INK: Final = "#1b1d22"
EDGE: Final = "#9aa1ad"
BLUE: Final = "#1f5fa8"
RED: Final = "#b3313e"
MEDIA_TYPE: Final = "image/png"
DPI: Final = 120
LABEL_PT: Final = 9
TICK_PT: Final = 8
WIDTH_IN: Final = 5.4
TAXEL_IN: Final = 0.34
BINS_PER_DECADE: Final = 20
WIDTH_MIN_IN: Final = 3.4
"""Space for a title of about 40 letters."""


def render_png(figure: "Figure") -> bytes:
    """Render a figure as PNG bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, facecolor="white", metadata={"Software": None})
    return buffer.getvalue()


def draw_board_map(kind: BoardKind, values: FloatArray, label: str, marked: BoolArray | None = None) -> bytes:
    """Draw one value per taxel at its crossing, TX lines down and RX lines to the right. Returns PNG bytes.

    values: f64[taxels]. marked: bool[taxels], taxels with a red frame.
    """
    grid = np.full(kind.crossings.shape, np.nan)
    grid[kind.crossings] = values
    rows, columns = kind.tx_count, kind.rx_count
    width = max(TAXEL_IN * columns + 1.6, WIDTH_MIN_IN)
    figure = _create_figure(width, TAXEL_IN * rows + 0.9)
    axes = figure.add_subplot()
    image = axes.imshow(grid, cmap="viridis", interpolation="nearest")
    figure.suptitle(
        label, x=0.02, ha="left", fontsize=LABEL_PT
    )  # The title has the width of the figure, because a board may be narrow.
    axes.set_xticks(range(columns))
    axes.set_yticks(range(rows))
    axes.set_xlabel("RX line", fontsize=LABEL_PT)
    axes.set_ylabel("TX line", fontsize=LABEL_PT)
    axes.tick_params(length=0, labelsize=TICK_PT)
    for side in axes.spines.values():
        side.set_visible(False)
    if marked is not None:
        for tx, rx in zip(kind.tx[marked].tolist(), kind.rx[marked].tolist(), strict=True):
            axes.add_patch(_make_frame(rx, tx))
    bar = figure.colorbar(image, ax=axes, shrink=0.9, fraction=0.06)
    bar.ax.tick_params(labelsize=TICK_PT)
    bar.outline.set_visible(False)
    return render_png(figure)


def _create_figure(width_in: float, height_in: float) -> "Figure":
    """Create an empty figure of the given size in inches. Raises an error that names the package if matplotlib is
    missing.
    """
    with optional_import("matplotlib", "a picture of the bench report"):
        from matplotlib.figure import Figure
    return Figure(figsize=(width_in, height_in), layout="constrained")


def _make_frame(x: int, y: int) -> "Rectangle":
    """Create a red frame around one element of the picture of a matrix. x, y: column and row of the element."""
    from matplotlib.patches import Rectangle

    return Rectangle((x - 0.5, y - 0.5), 1.0, 1.0, fill=False, edgecolor=RED, linewidth=2.0, clip_on=False)


def _make_axes(x: str, y: str, height: float = 3.2) -> "tuple[Figure, Any]":
    """Create a figure with one diagram in the style of the report; return the figure and its axes.

    x, y: labels of the axes; height: inches.
    """
    figure = _create_figure(WIDTH_IN, height)
    axes = figure.add_subplot()
    axes.set_xlabel(x, fontsize=LABEL_PT)
    axes.set_ylabel(y, fontsize=LABEL_PT)
    axes.tick_params(labelsize=TICK_PT)
    axes.grid(True, color="#e6e8ec", linewidth=0.7)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure, axes


def draw_spectrum(frequency_hz: FloatArray, density: FloatArray, white: float, rate_hz: float) -> bytes:
    """Draw the noise spectrum of an untouched board, averaged over bins of the frequency. Returns PNG bytes.

    density: f64[k], counts^2/Hz, mean over taxels, at frequency_hz f64[k]. white: standard deviation of the white noise
    in counts. rate_hz: frame rate.
    """
    figure, axes = _make_axes("frequency (Hz)", "counts² / Hz")
    bin_index = np.floor(BINS_PER_DECADE * np.log10(frequency_hz))
    bins = [bin_index == index for index in np.unique(bin_index)]
    centres, levels = ([float(values[mask].mean()) for mask in bins] for values in (frequency_hz, density))
    axes.loglog(centres, levels, color=BLUE, linewidth=1.2, label="mean over taxels")
    axes.axhline(
        white**2 / (rate_hz / 2.0),
        color=RED,
        linewidth=1.2,
        linestyle="--",
        label=f"white noise of each taxel: {white:.2f} counts",
    )
    _add_legend(axes)
    return render_png(figure)


def draw_time_course(time_s: FloatArray, counts: FloatArray, slope_per_min: float) -> bytes:
    """Draw the drift of a board with a line of its slope. Returns PNG bytes.

    counts: f64[k] at time_s f64[k]; the picture shows their change since the first value. slope_per_min: counts/min.
    """
    figure, axes = _make_axes("time (s)", "change (counts)", height=2.8)
    change = counts - counts[0]
    axes.plot(time_s, change, color=BLUE, marker="o", markersize=3, linewidth=1.0)
    line = slope_per_min / 60.0 * (time_s - time_s.mean()) + change.mean()
    axes.plot(time_s, line, color=RED, linestyle="--", linewidth=1.2, label=f"{slope_per_min:+.1f} counts/min")
    _add_legend(axes)
    return render_png(figure)


def draw_loading_curve(curve: Curve) -> bytes:
    """Draw the loading and unloading curves as in Figure 2.5 of the thesis. Returns PNG bytes.

    The lines are means over taxels, the shaded areas standard deviations.
    """
    figure, axes = _make_axes("force (N)", "count over count at rest", height=3.6)
    for branch, style, name in ((curve.loading, "-", "loading"), (curve.unloading, "--", "unloading")):
        mean = branch.mean(axis=0)
        spread = branch.std(axis=0, ddof=1) if len(branch) > 1 else np.zeros_like(mean)
        axes.plot(curve.force_n, mean, style, color=BLUE, linewidth=1.6, label=name)
        axes.fill_between(curve.force_n, mean - spread, mean + spread, color=BLUE, alpha=0.15, linewidth=0.0)
    _add_legend(axes, f"mean of {len(curve.loading)} taxels; shaded: standard deviation")
    return render_png(figure)


def draw_small_forces(
    force_n: FloatArray, signal: FloatArray, error: float, detectable_n: float, sigmas: float
) -> bytes:
    """Draw the signals under small forces, the noise of one frame and the detectable force. Returns PNG bytes.

    signal: f64[k], counts, at force_n f64[k]. error: standard deviation of one frame in counts. detectable_n: force at
    which the signal reaches `sigmas` standard deviations; NaN if there is none.
    """
    figure, axes = _make_axes("force (N)", "signal (counts)", height=3.0)
    axes.errorbar(force_n, signal, yerr=error, color=BLUE, marker="o", markersize=4, linewidth=1.0, capsize=2)
    axes.axhline(sigmas * error, color=RED, linestyle="--", linewidth=1.2, label=f"{sigmas:g} standard deviations")
    if np.isfinite(detectable_n):
        axes.axvline(detectable_n, color=EDGE, linewidth=1.2, label=f"detectable from {detectable_n:.3f} N")
    _add_legend(axes)
    return render_png(figure)


def _add_legend(axes: Any, title: str | None = None) -> None:
    """Add a legend without frame to a diagram."""
    axes.legend(frameon=False, fontsize=TICK_PT, title=title, title_fontsize=TICK_PT)
