"""Processor load of `taxel monitor` while the hand streams at the full bus rate, and the number of missed frames.

    python tools/bench/bench_monitor.py [--seconds 20] [--json]

The emulated hand runs in real time behind a pseudo-terminal, as `taxel emulate` runs it. The monitor is a separate
process on a terminal of 170 x 42 characters, or a page that one browser displays (skipped without chromium). The load
is the processor time of the monitor divided by the watched time, after the start.
"""

import argparse
import contextlib
import fcntl
import json
import os
import select
import shutil
import struct
import subprocess
import sys
import tempfile
import termios
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from figures import Figure
from recordings import make_settings

from host.tests.chromium import Page
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.emulator import find_emulator_program

BUSES = {"400 kHz": WorldSettings(), "1 MHz": make_settings(1e6, 3e6)}
WIDTH, HEIGHT = 170, 42
PAGE_TEXT = "the skin is at "
_CHILD = """
import json, sys, time
from rich.console import Console
from taxel.monitor import LineView, SkinMonitor, TerminalView, open_paced, watch
url, kind, seconds, out = sys.argv[1:]
with open_paced(url) as skin:
    monitor = SkinMonitor(skin)
    if kind == "terminal":
        view = TerminalView(Console(force_terminal=True, color_system="truecolor"), monitor, url)
        view.__enter__()
    elif kind == "browser":
        from taxel.monitor.web import WebView
        view = WebView(monitor, url, 0)
        print("the skin is at", view.url, flush=True)
    else:
        view = LineView(lambda text: None)
    initial = watch(skin, monitor, view, 8.0)  # establishes the baseline
    waited = 0
    while kind == "browser" and not view.has_client:
        initial = watch(skin, monitor, view, 1.0)
        waited += 1
        if waited > 60:
            sys.exit("no browser has opened the page within 60 s")
    start_s, start_cpu_s = time.monotonic(), time.process_time()
    reading = watch(skin, monitor, view, float(seconds))
    share = (time.process_time() - start_cpu_s) / (time.monotonic() - start_s)
    result = reading.as_dict() | {"cpu_share": share}
    for name in ("lost_on_wire", "missing", "damaged", "hub_dropped"):  # exclude losses during the start
        result[name] = (result[name] or 0) - (initial.as_dict()[name] or 0)
open(out, "w").write(json.dumps(result))
"""


@contextlib.contextmanager
def open_emulated_port(settings: WorldSettings) -> Iterator[str]:
    """Start an emulated hand in real time, and yield the URL of its pseudo-terminal."""
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        world = Path(folder) / "world.txt"
        world.write_text(format_world(load_hand("original"), settings))
        command = [str(find_emulator_program()), "--world", str(world), "--uart", "pty"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            try:
                yield process.stdout.readline().strip()
            finally:
                process.terminate()


def run_monitor(url: str, kind: str, seconds: float) -> dict[str, Any]:
    """Run a monitor as a process for `seconds`, and return its reading (`SkinReading.as_dict`).

    kind: view, "lines", "terminal" or "browser". The reading contains the share of one core as `cpu_share`; losses
    exclude those during the start.
    """
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        out = Path(folder) / "reading.json"
        command = [sys.executable, "-c", _CHILD, url, kind, repr(seconds), str(out)]
        master, slave = os.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", HEIGHT, WIDTH, 0, 0))
        process = subprocess.Popen(command, stdin=slave, stdout=slave)
        os.close(slave)
        browser: Page | None = None
        try:
            while process.poll() is None:
                if select.select([master], [], [], 0.5)[0]:
                    with contextlib.suppress(OSError):
                        text = os.read(master, 1 << 16).decode(errors="replace")
                        if kind == "browser" and browser is None and PAGE_TEXT in text:
                            browser = Page(text.split(PAGE_TEXT)[1].split()[0])
        finally:
            if browser is not None:
                browser.close()
            if process.poll() is None:
                process.kill()
                process.wait()
            os.close(master)
        reading: dict[str, Any] = json.loads(out.read_text())
        return reading


def measure_rows(buses: Sequence[str], kinds: Sequence[str], seconds: float) -> list[dict[str, Any]]:
    """Measure the load of the monitor, one table row for each bus and each view.

    buses: keys of `BUSES`. kinds: views, "lines", "terminal" or "browser".
    """
    rows = []
    for bus in buses:
        settings = BUSES[bus]
        for kind in kinds:
            with open_emulated_port(settings) as device:
                reading = run_monitor(f"serial://{device}?baud={settings.baud:.0f}", kind, seconds)
            keys = ("scans_hz", "frames_hz", "cpu_share", "lost_on_wire", "missing", "damaged", "hub_dropped")
            rows.append({"bus": bus, "view": kind, **{key: reading[key] for key in keys}, "age_s": reading["age_s"]})
            time.sleep(0.2)
    return rows


def count_missed_frames(row: dict[str, Any]) -> int:
    """Return the number of frames that the monitor should have received but did not. row: result of `measure_rows`."""
    return int(row["lost_on_wire"] + row["missing"] + row["damaged"] + (row["hub_dropped"] or 0))


def measure() -> list[Figure]:
    """Run the benchmark of the monitor: one core divided by the load of the terminal view, for each bus.

    The ratio is None if a frame was missed.
    """
    figures = []
    for row in measure_rows(list(BUSES), ["terminal"], seconds=6.0):
        lost = count_missed_frames(row)
        detail = f"{100 * row['cpu_share']:.0f} % of a core at {row['scans_hz']:.1f} scans/s, {lost} frames missed"
        ratio = None if lost else 1.0 / row["cpu_share"]
        figures.append(Figure(f"taxel monitor, {row['bus']}, in real time", ratio, 1.0, "one core", detail))
    return figures


def main() -> int:
    """Print the load of the monitor; exit status 1 if a frame was missed or a view needs a whole core."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    kinds = ["lines", "terminal", *(["browser"] if shutil.which("chromium") else [])]
    rows = measure_rows(list(BUSES), kinds, options.seconds)
    if options.json:
        print(json.dumps(rows, indent=2))
    else:
        print("| bus | view | scans/s | frames/s | share of one core | frames missed | age, median and largest |")
        print("|---|---|---|---|---|---|---|")
        for row in rows:
            median, largest = (1e3 * age for age in row["age_s"])
            print(
                f"| {row['bus']} | {row['view']} | {row['scans_hz']:.1f} | {row['frames_hz']:.0f} | "
                f"{100 * row['cpu_share']:.0f} % | {count_missed_frames(row)} | {median:.0f}, {largest:.0f} ms |"
            )
    return 1 if any(count_missed_frames(row) for row in rows) or any(row["cpu_share"] >= 1.0 for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
