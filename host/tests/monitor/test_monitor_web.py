"""The page in a browser: no complaint in its console, the hand in its colours, and what its controls do."""

from __future__ import annotations

import time

import numpy as np
import pytest

from host.tests.chromium import Page
from taxel.hand import load_hand
from taxel.monitor.colours import TABLE, steps_of
from taxel.monitor.page import status_html, table_html
from taxel.monitor.scene import scene_of

PATIENCE_S = 200.0
NEAR = 14
"""A pixel has a taxel's colour if each channel is as near as this: light falls on it from somewhere."""


def pixels_like(picture, colour):
    distance = np.abs(picture.astype(int) - np.asarray(colour, dtype=int)).max(axis=-1)
    return int((distance <= NEAR).sum())


class Show:
    """A puppet in the browser: `until` draws scans until the page fulfils a condition."""

    def __init__(self, skin, view, page):
        self.skin, self.view, self.page = skin, view, page

    def until(self, condition):
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            self.skin.pass_time(0.1)
            self.view.draw(self.skin.read())
            if condition():
                return
            time.sleep(0.4)  # without a graphics card the browser needs time to draw
        raise AssertionError(f"the page did not come to it: {self.page.text()!r}, {self.page.problems}")

    def until_text(self, words):
        self.until(lambda: words in self.page.text())

    def click(self, words):
        script = f"[...document.querySelectorAll('button')].find(b => b.innerText == {words!r}).click()"
        self.page.value(script)


@pytest.fixture
def show(puppet):
    web = pytest.importorskip("taxel.monitor.web", reason="no viser: pip install 'taxel[web]'")
    skin = puppet()
    skin.pass_time(1.0)
    with web.WebView(skin.monitor, "puppet", 0) as view, Page(view.url, 900, 600) as page:
        yield Show(skin, view, page)


def test_the_hand_is_seen_in_a_browser(show):
    skin = show.skin
    palm = skin.hand.get_slice(skin.hand.find_board("palm").address)
    show.until_text("17/17 boards")
    skin.raw[palm] -= 450
    show.until_text("121 active")
    for words in ("20.0 scans/s", "signal up to 450", "no errors", "back of hand"):
        show.until_text(words)
    lines = "[...document.querySelectorAll('.u-label')].map(element => element.innerText).join()"
    show.until(lambda: "palm" in show.page.value(lines))
    active, quiet = (TABLE[steps_of(np.array([signal]), 150.0, 500.0)[0]] for signal in (450.0, 0.0))

    def is_shown(least_active, most_active):
        picture = show.page.picture()
        return least_active < pixels_like(picture, active) < most_active and pixels_like(picture, quiet) > 1000

    show.until(lambda: is_shown(300, 100_000))
    show.click("back")
    show.until(lambda: is_shown(-1, 300))  # the palm is hidden now, the other side is seen
    show.click("Take the baseline again")
    show.until_text("\u00b7 0 active")
    assert show.page.problems == []


def test_nobody_is_given_a_public_address(puppet):
    web = pytest.importorskip("taxel.monitor.web", reason="no viser: pip install 'taxel[web]'")
    pytest.importorskip("viser")
    with web.WebView(puppet("flat8").monitor, "puppet", 0) as view:
        assert view._server.get_host() == "127.0.0.1"
        assert view._server.request_share_url() is None


def test_time_series_are_of_what_is_chosen(puppet):
    web = pytest.importorskip("taxel.monitor.web", reason="no viser: pip install 'taxel[web]'")
    pytest.importorskip("viser")
    skin = puppet()
    skin.pass_time(1.0)
    thumb = skin.hand.get_slice(skin.hand.find_board("fingertip_thumb").address)
    with web.WebView(skin.monitor, "puppet", 0) as view:
        for signal in (0, 300, 600):
            skin.raw[thumb.start + 7] -= signal
            skin.pass_time(0.1)
            view.draw(skin.read())
        view._choice.value = web.MOST_ACTIVE
        names, values = view._series()
        assert "fingertip thumb TX 3 RX 3" in names
        assert values[:, names.index("fingertip thumb TX 3 RX 3")].tolist() == [0.0, 300.0, 900.0]
        view._choice.value = web.BOARDS
        names, values = view._series()
        assert names[0] == "fingertip thumb"
        assert values.shape == (3, 5)
        view._choice.value = "palm"
        names, values = view._series()
        assert len(names) == 5
        assert all(name.startswith("palm TX ") for name in names)
        assert (values == 0.0).all()


def test_names_from_outside_are_text_on_the_page(puppet):
    skin = puppet()
    skin.pass_time(1.0)
    assert "<script>" not in status_html(skin.read(), "file:<script>")
    assert "proximal front middle" in table_html(skin.read())


@pytest.mark.parametrize("name", ["allegro", "flat8", "rig4"])
def test_every_taxel_has_a_place_outside_of_what_carries_it(name):
    hand = load_hand(name)
    scene = scene_of(hand)
    assert scene.position.shape == (hand.n_taxels, 3)
    assert scene.board_position.shape == (len(hand.boards), 3)
    assert abs(scene.outwards @ scene.up) < 0.3
    assert len(np.unique(scene.position.round(6), axis=0)) == hand.n_taxels
