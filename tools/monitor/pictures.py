"""Write the pictures of docs/how-to-monitor.md: both views of the emulated hand with five contacts.

python tools/monitor/pictures.py [--out docs/images]

Needs chromium for both pictures.
"""

import argparse
import io
import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console

from taxel.output import write_whole

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from host.tests.chromium import Page
from taxel.hand import load_hand
from taxel.hand.indentation import Indentation, compute_indentation_forces
from taxel.link import write_stimulus
from taxel.monitor import Screen, SkinMonitor, SkinReading, open_paced
from taxel.monitor.web import WebView

WIDTH, HEIGHT = 170, 36
INDENTATIONS = tuple(
    Indentation(board, tx, rx, force_n, start_s, hold_s=60.0, diameter_m=diameter_m)
    for board, tx, rx, force_n, start_s, diameter_m in (
        ("palm", 6.0, 5.0, 8.0, 8.0, 0.024),
        ("fingertip_index", 6.0, 4.0, 3.0, 12.0, 0.012),
        ("fingertip_pinkie", 8.0, 4.0, 5.0, 14.0, 0.018),
        ("proximal_front_middle", 5.0, 5.0, 5.0, 16.0, 0.016),
        ("back_of_hand", 3.0, 8.0, 12.0, 18.0, 0.024),
    )
)
END_S = 24.0
"""Time on the skin's clock at which all indentations are in contact, seconds."""

TITLE = "emulator: · hand original"
# viser warns about a missing graphics card, which a headless browser does not have.
REMOVE_NOTIFICATIONS = "for (const box of document.querySelectorAll('.mantine-Notification-root')) box.remove();"


def main() -> int:
    """Write the pictures of the monitor: monitor-terminal.png and monitor-web.png."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("docs/images"))
    out: Path = parser.parse_args().out
    hand = load_hand("original")
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        stimulus = Path(folder) / "indentations.stm"
        write_stimulus(stimulus, *compute_indentation_forces(hand, INDENTATIONS))
        with open_paced(f"emulator:?speed=max&stimulus={stimulus}", hand) as skin:
            monitor = SkinMonitor(skin)
            with WebView(monitor, TITLE, 0) as view:
                reading = _draw_until_contact(monitor, view)
                with Page(view.url, 1400, 860) as page:
                    _wait_for_page(view, reading, page)
                    page.take_picture()
                    write_whole(out / "monitor-web.png", page.png)
    console = Console(
        file=io.StringIO(), width=WIDTH, height=HEIGHT, record=True, color_system="truecolor", force_terminal=True
    )
    console.print(Screen(hand, TITLE, monitor.threshold).draw(reading, WIDTH, HEIGHT), soft_wrap=True)
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        drawing = Path(folder) / "terminal.svg"
        console.save_svg(str(drawing), title="taxel monitor")
        with Page(drawing.as_uri(), 1400, 640) as page:
            time.sleep(2.0)
            page.take_picture()
            write_whole(out / "monitor-terminal.png", page.png)
    return 0


def _draw_until_contact(monitor: SkinMonitor, view: WebView) -> SkinReading:
    """Draw ten readings per second of virtual time until all indentations are in contact (`END_S`).

    Returns the last reading of the skin.
    """
    due_s = 0.0
    while True:
        for frame in monitor.skin.poll():
            monitor.take([frame], time.monotonic())
            if frame.time_s >= due_s:
                reading = monitor.read(time.monotonic())
                view.draw(reading)
                due_s = frame.time_s + 0.1
                if due_s > END_S:
                    return reading


def _wait_for_page(view: WebView, reading: SkinReading, page: Page) -> None:
    """Draw a reading of the skin repeatedly until the browser page of the monitor shows it, at most for 30 s.

    Then notifications are removed from the page, which gets 5 s to finish drawing.
    """
    for _ in range(100):
        view.draw(reading)
        time.sleep(0.3)
        if "back of hand" in page.read_text():
            break
    page.evaluate(REMOVE_NOTIFICATIONS)
    time.sleep(5.0)


if __name__ == "__main__":
    sys.exit(main())
