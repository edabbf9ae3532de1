"""Screens of a reading on terminals of several sizes."""

import io

import numpy as np
import pytest
from rich.console import Console

from taxel.hand import load_hand
from taxel.monitor import Screen
from taxel.monitor.board_layout import layout_rows, layout_unrolled
from taxel.monitor.colours import INACTIVE_STEPS, STEPS, TABLE, UNKNOWN, ColourScale, colour_steps
from taxel.monitor.screen import HEADER_ROWS

SIZES = ((80, 24), (120, 40), (170, 50), (250, 70))


@pytest.fixture
def touch_reading(fake_skin):
    """A reading with one active taxel on the palm and one on the back of the hand."""
    skin = fake_skin()
    skin.pass_time(3.0)
    skin.read()
    for name in ("palm", "back_of_hand"):
        skin.raw[skin.hand.get_slice(skin.hand.find_board(name).address)][40] -= 500
    skin.pass_time(0.1)
    return skin.read()


def draw_screen(reading, width, height, shows_table=False, has_colour=True):
    """Draw a reading, and return the rows of the screen: lists of (character, foreground and background colour)."""
    drawer = Screen(load_hand("allegro"), "fake", 150.0)
    drawer.shows_table = shows_table
    console = Console(file=io.StringIO(), width=width, height=height, color_system="truecolor", force_terminal=True)
    canvas = drawer.draw(reading, width, height, has_colour)
    rows = [[]]
    for segment in canvas.__rich_console__(console, console.options):
        if segment.text == "\n":
            rows.append([])
            continue
        style = segment.style
        colours = [c.triplet if c is not None else None for c in (style.color, style.bgcolor)]
        rows[-1] += [(character, *colours) for character in segment.text]
    return rows


def join_characters(rows):
    """Return the text of the rows of a screen, without colours."""
    return "\n".join("".join(character[0] for character in row) for row in rows)


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_screen_fills_the_terminal_and_has_half_blocks_for_every_taxel_once(touch_reading, width, height):
    rows = draw_screen(touch_reading, width, height)
    assert len(rows) == height
    assert {len(row) for row in rows} == {width}
    half_blocks = sum(
        (foreground is not None) + (background is not None)
        for row in rows[HEADER_ROWS:]
        for character, foreground, background in row
        if character in "▀▄"
    )
    n_taxels = load_hand("allegro").n_taxels
    assert half_blocks in {n_taxels, 4 * n_taxels}  # 2 x 2 half blocks per taxel on a large terminal


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_exactly_the_two_active_taxels_have_the_colour_of_their_signal(touch_reading, width, height):
    rows = draw_screen(touch_reading, width, height)
    active_colour = tuple(TABLE[colour_steps(np.array([500.0]), threshold=150.0, top=500.0)[0]])
    half_blocks = sum(
        colour == active_colour for row in rows[HEADER_ROWS:] for _, *colours in row for colour in colours
    )
    assert half_blocks in {2, 4 * 2}  # 2 x 2 half blocks per taxel on a large terminal


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_header_has_title_rates_errors_and_active_taxels(touch_reading, width, height):
    text = join_characters(draw_screen(touch_reading, width, height))
    for expected_text in (
        "fake",
        "20.0 scans/s",
        "17/17 boards",
        "2 active",
        "signal up to 500",
        "no errors",
        "500 counts",
    ):
        assert expected_text in text


def test_table_is_always_shown_on_a_large_terminal_and_on_request_on_a_small_one(touch_reading):
    name_in_table = "medial back middle"  # the map has short names
    assert name_in_table in join_characters(draw_screen(touch_reading, 170, 50))
    assert name_in_table not in join_characters(draw_screen(touch_reading, 80, 24))
    assert name_in_table in join_characters(draw_screen(touch_reading, 80, 24, shows_table=True))


@pytest.mark.parametrize(("width", "height"), [(1, 1), (10, 3), (40, 12), (300, 5)])
def test_any_terminal_size_is_accepted(touch_reading, width, height):
    assert len(draw_screen(touch_reading, width, height)) == height


def test_without_colour_active_taxels_are_blocks_and_inactive_taxels_are_dots(touch_reading):
    rows = draw_screen(touch_reading, 80, 24, has_colour=False)
    text = join_characters(rows[HEADER_ROWS:])
    assert text.count("▀") + text.count("▄") == 2
    assert text.count("·") > 500  # a dot stands for one or two of the 1,071 inactive taxels


@pytest.mark.parametrize("name", ["allegro", "flat8", "rig4"])
def test_boards_and_their_labels_do_not_overlap(name):
    hand = load_hand(name)
    layouts = [layout_rows(hand, 80), layout_rows(hand, 160, 2), layout_unrolled(hand), layout_unrolled(hand, 2)]
    for layout in filter(None, layouts):
        assert {placed.board for placed in layout.boards} == set(hand.boards)
        occupied = np.zeros((layout.height, layout.width + 1), dtype=int)
        for placed in layout.boards:
            kind = placed.board.kind
            rows = -(-kind.tx_count * layout.scale // 2)  # a taxel is half as high as a character; rounded up
            occupied[placed.y : placed.y + rows, placed.x : placed.x + kind.rx_count * layout.scale] += 1
            occupied[placed.y - 1, placed.label_x : placed.label_x + len(placed.label) + 1] += 1
        for heading in layout.headings:
            occupied[heading.y, heading.x : heading.x + len(heading.text) + 1] += 1
        assert occupied.max() == 1


def test_only_the_default_hand_has_an_unrolled_layout():
    assert layout_unrolled(load_hand("allegro")) is not None
    assert layout_unrolled(load_hand("rig4")) is None


def test_default_hand_fits_an_80_by_24_terminal():
    assert layout_rows(load_hand("allegro"), 80).width <= 80
    assert layout_rows(load_hand("allegro"), 80).height <= 20


def test_luminance_increases_with_the_signal_and_doubles_at_the_threshold():
    colour = TABLE / 255.0
    linear_light = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)  # IEC 61966-2-1
    luminance = linear_light @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance[:STEPS]) > 0.0).all()
    assert luminance[INACTIVE_STEPS] > 2.0 * luminance[INACTIVE_STEPS - 1]


def test_colour_steps_change_from_inactive_to_active_above_the_threshold_and_end_at_the_top():
    signals = np.array([-50.0, 0.0, 150.0, 150.1, 499.0, 1e9, np.nan])
    steps = colour_steps(signals, threshold=150.0, top=500.0)
    assert steps.tolist() == [0, 0, INACTIVE_STEPS - 1, INACTIVE_STEPS, STEPS - 1, STEPS - 1, UNKNOWN]


def test_end_of_the_colour_scale_rises_immediately_and_falls_after_ten_seconds():
    """The end is rounded up to 1, 1.5, 2, 3, 5 or 7 times a power of ten, so 1200 counts have the end 1500."""
    scale = ColourScale(threshold=150.0, hold_s=10.0)
    assert scale.update(20.0, now_s=0.0) == 300.0  # the smallest end: two thresholds
    assert scale.update(1200.0, now_s=1.0) == 1500.0
    assert scale.update(20.0, now_s=8.0) == 1500.0
    assert scale.update(20.0, now_s=12.0) == 300.0
    assert scale.update(float("nan"), now_s=30.0) == 300.0
