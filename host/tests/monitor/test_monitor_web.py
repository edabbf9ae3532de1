"""The browser page: no errors in its console, colours of the hand, and effects of its controls."""

import time

import numpy as np
import pytest

from host.tests.chromium import Page
from taxel.hand import load_hand
from taxel.monitor.colours import TABLE, colour_steps
from taxel.monitor.web.page import format_status_html, format_table_html
from taxel.monitor.web.scene import build_scene

TIMEOUT_S = 200.0
COLOUR_TOLERANCE = 14
"""Largest difference of each channel between a pixel and the colour of its taxel, which the lighting of the scene
changes.
"""


def count_pixels(picture, colour):
    """Count the pixels of a picture u8[h, w, 3] whose channels differ from a colour by at most COLOUR_TOLERANCE."""
    difference = np.abs(picture.astype(int) - np.asarray(colour, dtype=int)).max(axis=-1)
    return int((difference <= COLOUR_TOLERANCE).sum())


class BrowserView:
    """A fake skin in a browser. `draw_until` draws readings until the page fulfils a condition."""

    def __init__(self, skin, view, page):
        self.skin, self.view, self.page = skin, view, page

    def draw_until(self, condition):
        """Draw new readings until `condition()` is true; fail after TIMEOUT_S."""
        deadline = time.monotonic() + TIMEOUT_S
        while time.monotonic() < deadline:
            self.skin.pass_time(0.1)
            self.view.draw(self.skin.read())
            if condition():
                return
            time.sleep(0.4)  # without a graphics card the browser needs time to draw
        raise AssertionError(f"the page does not fulfil the condition: {self.page.read_text()!r}, {self.page.problems}")

    def draw_until_text(self, text):
        self.draw_until(lambda: text in self.page.read_text())

    def click(self, text):
        """Click the button with this text."""
        script = f"[...document.querySelectorAll('button')].find(b => b.innerText == {text!r}).click()"
        self.page.evaluate(script)


def wait_without_drawing(condition):
    """Wait until `condition()` is true, without drawing a further reading; fail after TIMEOUT_S."""
    deadline = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.2)


@pytest.fixture
def browser(fake_skin):
    """A browser that shows a fake skin with a complete baseline, on a page with a baseline button."""
    web = pytest.importorskip("taxel.monitor.web", reason="no viser: pip install 'taxel[web]'")
    skin = fake_skin()
    skin.pass_time(1.0)
    with web.WebView(skin.monitor, "fake", 0, has_control=True) as view, Page(view.url, 900, 600) as page:
        yield BrowserView(skin, view, page)


def test_browser_shows_colours_texts_and_banners_and_its_buttons_work(browser):
    # One test for all of these, because the start of the browser takes most of the time.
    from taxel.monitor.web.view import PANEL_EVERY

    skin = browser.skin
    palm = skin.hand.get_slice(skin.hand.find_board("palm").address)
    browser.draw_until_text("17/17 boards")
    skin.raw[palm] -= 450
    browser.draw_until_text("121 active")
    for text in ("20.0 scans/s", "signal up to 450", "no errors", "back of hand"):
        browser.draw_until_text(text)
    lines = "[...document.querySelectorAll('.u-label')].map(element => element.innerText).join()"
    browser.draw_until(lambda: "palm" in browser.page.evaluate(lines))
    active, inactive = (TABLE[colour_steps(np.array([signal]), 150.0, 500.0)[0]] for signal in (450.0, 0.0))

    def is_shown(least_active, most_active):
        """Whether the number of pixels in the colour of an active taxel is between the two limits."""
        picture = browser.page.take_picture()
        return least_active < count_pixels(picture, active) < most_active and count_pixels(picture, inactive) > 1000

    browser.draw_until(lambda: is_shown(300, 100_000))
    browser.click("back")
    browser.draw_until(lambda: is_shown(-1, 300))  # the palm is hidden, the back of the hand is visible
    browser.click("Take the baseline again")
    browser.draw_until_text("\u00b7 0 active")
    skin.now_s += 10.0  # without frames
    browser.view._drawings = PANEL_EVERY - 1  # the next drawing updates the panel
    browser.view.draw(skin.read())
    wait_without_drawing(lambda: "no data since" in browser.page.read_text())
    browser.draw_until(lambda: "no data since" not in browser.page.read_text())
    wait_without_drawing(lambda: "the program does not respond" in browser.page.read_text())
    assert browser.page.problems == []


def test_server_listens_on_loopback_and_cannot_be_shared_by_a_public_address(fake_skin):
    """The function of viser that requests a public address from a relay is replaced by a function that does nothing."""
    web = pytest.importorskip("taxel.monitor.web", reason="no viser: pip install 'taxel[web]'")
    pytest.importorskip("viser")
    from taxel.monitor.web.server import _disable_sharing

    with web.WebView(fake_skin("flat8").monitor, "fake", 0) as view:
        assert view._server.get_host() == "127.0.0.1"
        # viser's own function also returns None if its relay cannot be reached.
        assert view._server.request_share_url is _disable_sharing
        assert view._server.request_share_url() is None


def test_time_series_are_those_of_the_selection(fake_skin):
    from taxel.monitor.web.view import BOARDS, LINES, MOST_ACTIVE

    web = pytest.importorskip("taxel.monitor.web", reason="no viser: pip install 'taxel[web]'")
    pytest.importorskip("viser")
    skin = fake_skin()
    skin.pass_time(1.0)
    thumb = skin.hand.get_slice(skin.hand.find_board("fingertip_thumb").address)
    touched_taxel = thumb.start + 7
    touched_name = f"fingertip thumb TX {skin.hand.tx[touched_taxel]} RX {skin.hand.rx[touched_taxel]}"
    with web.WebView(skin.monitor, "fake", 0) as view:
        for signal_increase in (0, 300, 600):
            skin.raw[touched_taxel] -= signal_increase
            skin.pass_time(0.1)
            view.draw(skin.read())
        view._choice.value = MOST_ACTIVE
        names, values = view._select_series()
        assert values[:, names.index(touched_name)].tolist() == [0.0, 300.0, 900.0]
        view._choice.value = BOARDS
        names, values = view._select_series()
        assert names[0] == "fingertip thumb"
        assert values.shape == (3, LINES)  # three readings
        view._choice.value = "palm"
        names, values = view._select_series()
        assert len(names) == LINES
        assert all(name.startswith("palm TX ") for name in names)
        assert (values == 0.0).all()


def test_html_in_the_title_is_escaped(fake_skin):
    skin = fake_skin()
    skin.pass_time(1.0)
    assert "<b>file:&lt;script&gt;</b>" in format_status_html(skin.read(), "file:<script>")


def test_table_of_the_page_has_the_names_of_all_boards(fake_skin):
    skin = fake_skin()
    skin.pass_time(1.0)
    table = format_table_html(skin.read())
    assert all(f">{board.name.replace('_', ' ')}</td>" in table for board in skin.hand.boards)


@pytest.mark.parametrize("name", ["allegro", "flat8", "rig4"])
def test_drawn_taxels_have_different_positions(name):
    hand = load_hand(name)
    scene = build_scene(hand)
    assert scene.position.shape == (hand.n_taxels, 3)
    assert len(np.unique(scene.position.round(6), axis=0)) == hand.n_taxels


@pytest.mark.parametrize("name", ["allegro", "flat8", "rig4"])
def test_scene_has_a_label_position_for_each_board_and_an_upward_direction_along_the_skin(name):
    hand = load_hand(name)
    scene = build_scene(hand)
    assert scene.board_position.shape == (len(hand.boards), 3)
    assert abs(scene.outwards @ scene.up) < 0.3  # nearly perpendicular unit vectors
