"""View of the skin in a browser: the hand in 3-D, time series and a table. Needs viser."""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Callable
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from taxel.monitor.colours import TABLE, UNKNOWN, ColourScale, colour_steps
from taxel.monitor.history import History
from taxel.monitor.model import SkinMonitor
from taxel.monitor.reading import SkinReading
from taxel.monitor.web.gate import Gate
from taxel.monitor.web.page import format_legend_html, format_status_html, format_table_html
from taxel.monitor.web.refusals import Refusals
from taxel.monitor.web.scene import HandScene, build_scene
from taxel.monitor.web.server import HOST, start_server
from taxel.optional import require_packages
from taxel.types import Float32Array

if TYPE_CHECKING:
    import viser

LINES = 5
"""Number of time series in the plot."""

SHOWN_S = 30.0
"""Duration of the time series, seconds."""

LINE_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
"""Colours of the time series, distinguishable by colour-blind people (Okabe and Ito)."""

PANEL_EVERY = 3
"""Number of drawings between two updates of the panel's texts: three updates per second are sufficient for reading."""

MOST_ACTIVE = "the most active taxels"
BOARDS = "the most active boards"
PALM, BACK = "palm side", "back"
LINK_COLOUR = (205, 207, 212)


def _print_line(text: str) -> None:
    """Print a line of the page's server to standard error."""
    print(f"taxel: {text}", file=sys.stderr, flush=True)


class WebView:
    """View of the monitor as a web page, served on 127.0.0.1 until `close` to browsers that open `url`.

    A context manager and a `taxel.monitor.View`. Requests and messages of pages are checked before use
    (`taxel.monitor.web.gate`, `taxel.monitor.web.page_input`). `refusals` counts refused requests and messages.
    """

    def __init__(
        self,
        monitor: SkinMonitor,
        title: str,
        port: int = 8080,
        has_control: bool = False,
        report: Callable[[str], None] = _print_line,
    ) -> None:
        """Start a web server on 127.0.0.1 with a page that shows a 3D drawing of the hand and a control panel.

        title: heading of the page. port: 0 for a free port. has_control: the page has a button that measures the
        baseline again; False: the page cannot change the monitor. report: called with one line for the first refusal of
        each kind. Raises MissingPackageError if viser is not installed, WebError if the port is not available,
        HandGeometryError for a hand description without geometry.
        """
        self._monitor = monitor
        self._title = title
        self._scene = build_scene(monitor.hand)
        self._scale = ColourScale(monitor.threshold)
        self._history = History(monitor.hand.n_taxels)
        self._drawings = 0
        self._gate = Gate()
        self.refusals = Refusals(report)
        require_packages("--web", "web", "viser")
        from taxel.monitor.web.page_input import PageInput  # needs msgspec, which viser installs

        self._input = PageInput()
        self._server = start_server(port, self._gate, self.refusals, self._input.check)
        self._draw_hand()
        self._create_panel(has_control)

    @property
    def url(self) -> str:
        """Address of the page, with the token of this run: anyone on this computer who has the address can open it."""
        return f"http://{HOST}:{self._server.get_port()}/?token={self._gate.token}"

    @property
    def has_client(self) -> bool:
        """Whether a browser shows the page."""
        return bool(self._server.get_clients())

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the web server of the view at the end of the `with` block."""
        self.close()

    def close(self) -> None:
        """Stop the web server of the page."""
        with contextlib.redirect_stdout(io.StringIO()):  # viser prints a message
            self._server.stop()

    def _draw_hand(self) -> None:
        """Add links, taxels and board names to the scene, and set the camera."""
        server, hand = self._server, self._scene
        server.scene.set_up_direction(tuple(hand.up))
        server.scene.world_axes.visible = False
        _draw_links(server, hand)
        self._steps = np.full(len(hand.position), UNKNOWN)
        self._taxels = server.scene.add_point_cloud(
            "/taxels", hand.position, TABLE[self._steps], point_size=0.5 * hand.size_m,
            point_shape="square", point_shading="flat", precision="float32",
        )  # fmt: skip
        self._names = [
            server.scene.add_label(
                f"/names/{board.name}", board.name.replace("_", " "), position=position, visible=False
            )
            for board, position in zip(self._monitor.hand.boards, hand.board_position, strict=True)
        ]
        server.initial_camera.position = self._get_camera_position(PALM)
        server.initial_camera.look_at = tuple(hand.centre)
        server.initial_camera.up = tuple(hand.up)

    def _get_camera_position(self, side: str) -> tuple[float, float, float]:
        """Compute the camera position from which one side of the hand is visible, metres.

        The camera views the hand obliquely, from the side and from above (chosen by eye), at a distance of 1.75 radii
        of the hand. side: `PALM` or `BACK`.
        """
        sign = 1.0 if side == PALM else -1.0
        sideways = np.cross(self._scene.up, self._scene.outwards)
        direction = sign * (self._scene.outwards + 0.35 * sideways) + 0.15 * self._scene.up
        x, y, z = self._scene.centre + 1.75 * self._scene.radius * direction / np.linalg.norm(direction)
        return float(x), float(y), float(z)

    def _create_panel(self, has_control: bool) -> None:
        """Create the control panel of the web page: status, view buttons, baseline button, plot and table.

        has_control: whether the panel has the baseline button.
        """
        gui = self._server.gui
        gui.configure_theme(control_width="large", show_logo=False, show_share_button=False)
        gui.main_panel.dock_right()
        self._status = gui.add_html("")
        self._legend = gui.add_html("")
        side = gui.add_button_group("view", (PALM, BACK))
        names = gui.add_checkbox("board names", initial_value=False)
        if has_control:
            self._add_baseline_button()
        self._options = options = (BOARDS, MOST_ACTIVE, *(board.name for board in self._monitor.hand.boards))
        self._choice = gui.add_dropdown("signal over time of", options, initial_value=BOARDS)
        self._plotted, self._plotted_top = tuple(f"line {number}" for number in range(LINES)), self._scale.top
        self._plot = gui.add_uplot(
            (np.array([-1.0, 0.0]), *([np.full(2, np.nan)] * LINES)), _make_line_styles(self._plotted),
            scales=_make_scales(self._plotted_top), axes=({"label": "seconds before now"}, {"label": "signal, counts"}),
            legend={"live": False}, height=200, padding=(10, 24, 0, 0),
        )  # fmt: skip
        self._table = gui.add_html("")

        self._input.allow(side._impl.uuid, (PALM, BACK))
        self._input.allow(names._impl.uuid, (False, True))
        self._input.allow(self._choice._impl.uuid, frozenset(options))

        @side.on_click
        def _(event: Any) -> None:
            """Turn the camera of the browser that selected a side of the hand."""
            if event.client is not None:
                with event.client.atomic():
                    event.client.camera.up_direction = tuple(self._scene.up)
                    event.client.camera.position = self._get_camera_position(side.value)
                    event.client.camera.look_at = tuple(self._scene.centre)

        @names.on_update
        def _(event: Any) -> None:
            """Show or hide the board names in all browsers."""
            for label in self._names:
                label.visible = names.value

    def _add_baseline_button(self) -> None:
        """Add the button that measures the baseline again."""
        hint = "Nothing may touch the skin during the baseline."
        baseline = self._server.gui.add_button("Take the baseline again", hint=hint)
        self._input.allow(baseline._impl.uuid, (True,))

        @baseline.on_click
        def _(event: Any) -> None:
            self._monitor.restart_baseline()

    def draw(self, reading: SkinReading) -> None:
        """Show a reading of the skin in all connected browsers; without a browser, the reading is only stored."""
        self._history.add(reading)
        self._drawings += 1
        if not self.has_client and not reading.is_ended:
            return
        top = self._scale.update(reading.largest_signal, reading.watched_s)
        with self._server.atomic():
            steps = colour_steps(reading.signal_counts, self._scale.threshold, top)
            if not np.array_equal(steps, self._steps):  # a browser draws the whole hand again for each change
                self._taxels.colors, self._steps = TABLE[steps], steps
            if self._drawings % PANEL_EVERY == 0 or reading.is_ended:
                self._status.content = format_status_html(reading, self._title)
                self._legend.content = format_legend_html(self._scale.threshold, top)
                self._table.content = format_table_html(reading)
                self._draw_series(top)

    def _draw_series(self, top: float) -> None:
        """Update the plot of signals over time. top: end of the scale, counts."""
        times = self._history.times_s
        if len(times) < 2:
            return
        names, values = self._select_series()
        if names != self._plotted:
            self._plot.series, self._plotted = _make_line_styles(names), names
        if top != self._plotted_top:
            self._plot.scales, self._plotted_top = _make_scales(top), top
        self._plot.data = (times, *(column.astype(np.float64) for column in values.T))

    def _select_series(self) -> tuple[tuple[str, ...], Float32Array]:
        """Return the names and the signals f32[t, k], counts, of the k time series that the user has selected.

        The rows are the t stored readings, oldest first. At most `LINES` series are returned.
        """
        hand, selection = self._monitor.hand, self._choice.value
        if selection not in self._options or selection == BOARDS:
            signals = self._history.taxels(np.arange(hand.n_taxels))
            boards = np.stack([_compute_row_maximum(part) for part in hand.split(signals).values()], axis=1)
            order = np.argsort(-np.nan_to_num(boards, nan=-np.inf).max(axis=0, initial=-np.inf), kind="stable")[:LINES]
            return tuple(_format_title(hand.boards[i].name) for i in order), boards[:, order]
        index = self._history.find_most_active(hand.n_taxels)
        if selection != MOST_ACTIVE:
            index = index[hand.sensor[index] == hand.find_board(selection).address]
        # In the hand's order, so that the colours of two taxels do not change when their signals cross.
        index = np.sort(index[:LINES])
        names = tuple(
            f"{_format_title(hand.boards[hand.board_index[i]].name)} TX {hand.tx[i]} RX {hand.rx[i]}" for i in index
        )
        return names, self._history.taxels(index)

    def is_done(self, reading: SkinReading) -> bool:
        """Return False: the page is served until the program ends."""
        return False


def _format_title(name: str) -> str:
    """Return the name of a board with spaces instead of underscores."""
    return name.replace("_", " ")


def _compute_row_maximum(signals: Float32Array) -> Float32Array:
    """Return the largest known signal of each row, f32[t]; NaN if all signals of the row are unknown.

    signals: f32[t, k], t readings of k taxels, counts.
    """
    largest = np.nan_to_num(signals, nan=-np.inf).max(axis=1, initial=-np.inf)
    return np.where(np.isfinite(largest), largest, np.nan).astype(np.float32)


def _make_line_styles(names: tuple[str, ...]) -> tuple[Any, ...]:
    """Return the styles of the time axis and of each named line of the plot, in the format of the library uPlot."""
    lines = [{"label": name, "stroke": colour, "width": 1.5} for name, colour in zip(names, LINE_COLOURS, strict=False)]
    return ({"label": "time"}, *lines)


def _make_scales(top: float) -> dict[str, Any]:
    """Return the ranges of the plot's axes: the last `SHOWN_S` seconds, and 0 to `top` counts."""
    return {"x": {"time": False, "range": (-SHOWN_S, 0.0)}, "y": {"range": (-0.05 * top, top)}}


def _draw_links(server: viser.ViserServer, hand: HandScene) -> None:
    """Add the links of the hand to the scene, as boxes and capsules."""
    from taxel.hand.transforms import to_quaternion

    for number, (shape, pose) in enumerate(hand.links):
        name, wxyz = f"/links/{number}", to_quaternion(pose)
        if shape.type == "box":
            x, y, z = (2.0 * half for half in shape.size)
            server.scene.add_box(
                name, LINK_COLOUR, (x, y, z), wxyz=wxyz, position=pose[:3, 3], cast_shadow=False, receive_shadow=False
            )
            continue
        radius, half = shape.size
        server.scene.add_cylinder(
            f"{name}/middle", radius, 2.0 * half, LINK_COLOUR, wxyz=wxyz, position=pose[:3, 3],
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        for end, side in enumerate((-1.0, 1.0)):
            server.scene.add_icosphere(
                f"{name}/end{end}", radius, LINK_COLOUR, position=pose[:3, 3] + side * half * pose[:3, 2],
                cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
