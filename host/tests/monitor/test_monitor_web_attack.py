"""Hostile requests and messages to the page of the monitor: short forms of `make attack-web` and `make load-web`."""

import asyncio
import sys
import time
from pathlib import Path

import pytest

from taxel.monitor.web.gate import TICKETS_MAX, Gate, Refusal

pytest.importorskip("viser", reason="no viser: pip install 'taxel[web]'")
pytest.importorskip("websockets")
sys.path.insert(0, str(Path(__file__).parents[3] / "tools" / "attack"))

import msgspec
from attack_web import (
    attack_messages,
    attack_requests,
    count_accepted,
    read_control_uuids,
)
from hostile_messages import make_message
from load_web import CAMERA
from page_client import Request, open_page, send

from taxel.monitor.web import WebView
from taxel.monitor.web.admission import CLIENTS_MAX, IGNORED_MAX, POLICY_VIOLATION
from taxel.monitor.web.page_input import MESSAGE_BYTES_MAX, PageInput
from taxel.monitor.web.view import BOARDS, PANEL_EVERY

SEED = 3
TIMEOUT_S = 60.0


class ServedPage:
    """A served page of a fake skin.

    request: the request with which a user opens the page. lines: lines that the view has reported. restarts: an entry
    for each restart of the baseline.
    """

    def __init__(self, skin, view, lines, restarts):
        self.skin, self.view, self.lines, self.restarts = skin, view, lines, restarts
        self.request = Request.of_page(view.url)

    def draw(self):
        """Draw a reading with new frames."""
        self.skin.pass_time(0.1)
        self.view.draw(self.skin.read())


@pytest.fixture
def serve(fake_skin, monkeypatch):
    """A function that serves the page of a fake skin. Its options are those of `WebView`."""
    views = []

    def start(**options):
        skin, lines, restarts = fake_skin("flat8"), [], []
        monkeypatch.setattr(skin.monitor, "restart_baseline", lambda: restarts.append(True))
        view = WebView(skin.monitor, "fake", 0, report=lines.append, **options)
        views.append(view)
        return ServedPage(skin, view, lines, restarts)

    yield start
    for view in views:
        view.close()


def wait_until(condition):
    """Wait until a condition that another thread fulfils is true."""
    deadline = time.monotonic() + TIMEOUT_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def update(uuid, value):
    """Encode a message of the page that sets the control `uuid` to a value."""
    return msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})


def test_hostile_requests_are_refused(serve):
    served = serve()
    results = asyncio.run(attack_requests(served.request, 105, SEED))
    assert count_accepted(results) == 0
    assert all(sum(counts.values()) == 15 for counts in results.values())  # 105 requests of 7 kinds
    assert {Refusal.FOREIGN_HOST, Refusal.FOREIGN_ORIGIN, Refusal.NO_TOKEN, Refusal.OTHER_CLIENT} <= set(
        served.view.refusals.counts
    )
    assert len(served.lines) == len(served.view.refusals.counts)  # each kind is reported once


def test_hostile_messages_change_nothing(serve):
    served = serve(has_control=True)
    ordinary, oversized = asyncio.run(attack_messages(served.request, 240, SEED))
    # Every ordinary message is counted as refused. An oversized message ends its connection and is not counted.
    wait_until(lambda: served.view.refusals.total == ordinary)
    assert oversized > 0
    assert not served.restarts
    assert served.view._choice.value == BOARDS
    served.draw()  # the view still works


def test_unknown_values_and_uploads_are_refused_and_leave_the_monitor_running(serve):
    served = serve()

    async def send_messages():
        connection = await open_page(served.request)
        await connection.send(CAMERA)
        for uuid in await read_control_uuids(connection):
            await connection.send(update(uuid, "no such board"))
            await connection.send(
                msgspec.msgpack.encode(
                    {"type": "FileTransferStartUpload", "source_component_uuid": uuid, "transfer_uuid": "t"}
                    | {"filename": "f", "mime_type": "text/plain", "part_count": 1, "size_bytes": 1}
                )
            )
        await connection.close()

    asyncio.run(send_messages())
    wait_until(lambda: served.view.refusals.total > 0)
    for _ in range(PANEL_EVERY + 1):
        served.draw()
    assert "\x1b" not in "".join(served.lines)  # no control sequence reaches the terminal


@pytest.mark.parametrize("has_control", [False, True])
def test_page_can_restart_the_baseline_only_with_control(serve, has_control):
    served = serve(has_control=has_control)

    async def set_all_controls():
        connection = await open_page(served.request)
        await connection.send(CAMERA)
        wait_until(lambda: served.view.has_client)
        for uuid in await read_control_uuids(connection):
            await connection.send(update(uuid, True))
        await connection.ping()
        await connection.close()

    asyncio.run(set_all_controls())
    if has_control:
        wait_until(lambda: served.restarts)
    wait_until(lambda: served.view.refusals.total > 0)
    assert len(served.restarts) == has_control


def test_page_can_be_reloaded_with_its_cookie_and_each_ticket_permits_one_connection(serve):
    served = serve()

    async def reload():
        first = await send(served.request)
        reloaded = await send(served.request.with_headers(("Cookie", first.cookie)))
        assert reloaded.status == 200
        opened = await send(served.request.as_connection(reloaded.cookie))
        assert opened.status == 101
        assert (await send(served.request.as_connection(opened.cookie))).status == 101  # after a lost connection
        assert (await send(served.request.as_connection(opened.cookie))).status == 403  # a ticket is valid once

    asyncio.run(reload())


def test_address_of_another_run_is_refused(serve):
    first, second = serve(), serve()
    old = Request(second.request.address, second.request.port, first.request.target)
    response = asyncio.run(send(old))
    assert response.status == 403


def test_headers_of_the_page_forbid_frames_caches_referrers_and_scripts_that_read_the_cookie(serve):
    text = asyncio.run(send(serve().request)).text
    for header in ("frame-ancestors 'none'", "Cache-Control: no-store", "Referrer-Policy: no-referrer", "HttpOnly"):
        assert header in text


def test_page_above_the_largest_number_of_pages_is_refused(serve):
    served = serve()

    async def open_pages():
        pages = [await open_page(served.request) for _ in range(CLIENTS_MAX)]
        refused = await send(served.request.as_connection((await send(served.request)).cookie))
        for page in pages:
            page.transport.abort()
        return refused.status

    assert asyncio.run(open_pages()) == 503


def test_page_is_disconnected_after_the_largest_number_of_invalid_messages(serve):
    served = serve()

    async def send_invalid_messages():
        connection = await open_page(served.request)
        for _ in range(IGNORED_MAX):
            await connection.send(b"garbage")
        await connection.wait_closed()
        return connection.close_code

    assert asyncio.run(send_invalid_messages()) == POLICY_VIOLATION
    assert served.view.refusals.counts == {Refusal.MALFORMED: IGNORED_MAX}


def test_slow_reader_does_not_delay_other_pages(serve):
    served = serve()

    async def read_beside_slow_readers():
        slow = [await open_page(served.request, max_queue=1) for _ in range(8)]
        for connection in slow:
            await connection.send(CAMERA)
            connection.transport.pause_reading()
        reader = await open_page(served.request)
        await read_control_uuids(reader)
        await reader.send(CAMERA)
        await asyncio.to_thread(wait_until, lambda: served.view.has_client)
        for _ in range(10):
            for _ in range(PANEL_EVERY):
                await asyncio.to_thread(served.draw)
            await asyncio.wait_for(reader.recv(), TIMEOUT_S)
        for connection in (*slow, reader):
            connection.transport.abort()

    asyncio.run(read_beside_slow_readers())


def test_used_port_is_reported_with_one_line(serve, fake_skin):
    from taxel.monitor.web import WebError

    served = serve()
    with pytest.raises(WebError, match=f"port {served.request.port} of 127.0.0.1 is not available"):
        WebView(fake_skin("flat8").monitor, "fake", served.request.port)


def test_page_is_not_served_by_a_viser_without_checks(fake_skin, monkeypatch):
    """Without the names that `_Override` replaces, the checks are not installed, as in another version of viser."""
    from taxel.monitor.web import WebError, server

    monkeypatch.setattr(server, "_Override", lambda module, **names: module)
    with pytest.raises(WebError, match="cannot be protected"):
        WebView(fake_skin("flat8").monitor, "fake", 0)


def test_number_of_unused_tickets_is_limited():
    gate = Gate()
    for _ in range(TICKETS_MAX + 10):
        gate.make_cookie()
    assert len(gate._tickets) == TICKETS_MAX


def test_only_camera_poses_and_known_values_of_known_controls_are_accepted():
    page_input = PageInput()
    page_input.allow("side", ("palm side", "back"))
    assert page_input.check(CAMERA) is None
    assert page_input.check(update("side", "back")) is None
    assert page_input.check(update("side", True)) is Refusal.UNKNOWN_VALUE
    assert page_input.check(update("other", "back")) is Refusal.UNKNOWN_CONTROL
    assert page_input.check(b"\0" * (MESSAGE_BYTES_MAX + 1)) is Refusal.MALFORMED


def test_random_messages_are_never_accepted():
    import random

    rng, page_input = random.Random(SEED), PageInput()
    page_input.allow("side", ("palm side", "back"))
    assert all(page_input.check(make_message(rng, ["side"])) is not None for _ in range(2000))
