"""The page of a diagnosis is opened on request only."""

import webbrowser

import pytest
import typer

from taxel.cli import open_page
from taxel.cli.open_page import offer_page


@pytest.fixture
def opened(monkeypatch):
    """Addresses that the program has opened in the (replaced) browser."""
    addresses = []
    monkeypatch.setattr(webbrowser, "open", lambda address: addresses.append(address) or True)
    return addresses


def set_terminal(monkeypatch, is_terminal, has_browser=True):
    """Let the program run on a terminal or not, with a browser or without."""
    for stream in (open_page.sys.stdin, open_page.sys.stdout):
        monkeypatch.setattr(stream, "isatty", lambda: is_terminal, raising=False)
    monkeypatch.setattr(open_page, "_has_browser", lambda: has_browser)


@pytest.mark.parametrize(("is_wanted", "number"), [(True, 1), (False, 0)])
def test_the_option_decides_whether_the_page_is_opened(is_wanted, number, opened, tmp_path):
    offer_page(tmp_path / "report.html", is_wanted)
    assert opened == [(tmp_path / "report.html").as_uri()] * number


def test_without_a_terminal_or_a_browser_no_question_is_printed_and_no_page_is_opened(opened, tmp_path, monkeypatch):
    monkeypatch.setattr(typer, "confirm", lambda *arguments, **options: pytest.fail("a question"))
    for is_terminal, has_browser in ((False, True), (True, False)):
        set_terminal(monkeypatch, is_terminal, has_browser)
        offer_page(tmp_path / "report.html", None)
    assert opened == []


@pytest.mark.parametrize(("answer", "number"), [(True, 1), (False, 0)])
def test_the_answer_on_a_terminal_decides_whether_the_page_is_opened(answer, number, opened, tmp_path, monkeypatch):
    set_terminal(monkeypatch, True)
    monkeypatch.setattr(typer, "confirm", lambda *arguments, **options: answer)
    offer_page(tmp_path / "report.html", None)
    assert len(opened) == number


def test_a_missing_browser_is_reported_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(webbrowser, "open", lambda address: False)
    offer_page(tmp_path / "report.html", True)
    assert (
        capsys.readouterr().err
        == f"{tmp_path / 'report.html'}: no browser is available; open the file on another computer\n"
    )
