"""The page of a twin answers only its own token and the names of the loopback interface."""

import http.client
from types import SimpleNamespace

import pytest

from host.tests.twin.synthetic_skin import make_tables
from taxel.twin.places import Places
from taxel.twin.web import TwinPage


@pytest.fixture
def page():
    taxels, sensors = make_tables()
    reference = SimpleNamespace(taxels=taxels, sensors=sensors, places=Places.of(taxels, sensors))
    with TwinPage(SimpleNamespace(twin=SimpleNamespace(reference=reference, active={}))) as page:
        yield page


def get(page, path: str, method: str = "GET", **headers: str) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", page.port, timeout=10)
    connection.request(method, path, headers=headers)
    status = connection.getresponse().status
    connection.close()
    return status


def test_page_is_sent_for_its_token(page):
    assert get(page, page.url.split(str(page.port))[1]) == 200


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/events", "/events?token=x", "/../etc/passwd"])
def test_request_without_the_token_is_refused(page, path):
    assert get(page, path) == 403


def test_foreign_host_name_is_refused(page):
    assert get(page, page.url.split(str(page.port))[1], Host="attacker.example:80") == 403


def test_request_that_writes_is_refused(page):
    assert get(page, page.url.split(str(page.port))[1], "POST") == 501
