"""The server of a twin's page answers only requests with its token and a host name of the loopback interface."""

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


def request_status(page, path: str, method: str = "GET", **headers: str) -> int:
    """Send a request to the page; return the HTTP status of the answer."""
    connection = http.client.HTTPConnection("127.0.0.1", page.port, timeout=10)
    connection.request(method, path, headers=headers)
    status = connection.getresponse().status
    connection.close()
    return status


def get_path_with_token(page) -> str:
    return page.url.split(str(page.port))[1]


def test_request_with_the_token_gets_the_page(page):
    assert request_status(page, get_path_with_token(page)) == 200


@pytest.mark.parametrize("path", ["/", "/?token=", "/?token=wrong", "/events", "/events?token=x", "/../etc/passwd"])
def test_request_without_the_correct_token_is_forbidden(page, path):
    assert request_status(page, path) == 403


def test_request_with_a_foreign_host_name_is_forbidden(page):
    assert request_status(page, get_path_with_token(page), Host="attacker.example:80") == 403


def test_post_request_is_not_supported(page):
    assert request_status(page, get_path_with_token(page), "POST") == 501
