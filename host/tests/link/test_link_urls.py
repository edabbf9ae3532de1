"""URLs of serial ports, emulators and captures: spellings, options, and one-line errors for invalid URLs."""

import pickle
from pathlib import Path

import pytest

import taxel
from taxel.link import (
    CaptureError,
    CaptureLink,
    CaptureWriter,
    LinkError,
    PortMissingError,
    SerialLink,
    open_link,
)

EMULATOR_OPTIONS = (
    "baud", "clock_spread_ppm", "duration_s", "noise_counts", "scl_hz", "seed", "speed", "stimulus", "threads",
    "usb_latency_ms",
)  # fmt: skip


def read_single_line(error: BaseException) -> str:
    """Check that the text of an exception is one non-empty line, and return it."""
    text = str(error)
    assert text
    assert "\n" not in text
    return text


@pytest.mark.parametrize("url_pattern", ["serial://{}", "{}", "serial:{}"])
def test_a_serial_port_has_three_spellings(terminal, url_pattern):
    link = open_link(url_pattern.format(terminal.name))
    assert isinstance(link, SerialLink)
    assert (link.baud, link.is_real_time, link.is_recorded) == (1e6, True, False)
    link.close()


def test_the_baud_rate_of_a_serial_url_is_that_of_the_link(terminal):
    link = open_link(f"serial://{terminal.name}?baud=115200&rtscts=0&low_latency=0")
    assert link.baud == 115200
    link.close()


@pytest.mark.parametrize(("query", "has_flow_control"), [("", False), ("?rtscts=0", False), ("?rtscts=1", True)])
def test_a_serial_link_has_flow_control_only_with_rtscts_1(terminal, query, has_flow_control):
    link = open_link(f"serial://{terminal.name}{query}")
    assert link.has_flow_control is has_flow_control
    link.close()


@pytest.mark.parametrize("url_pattern", ["file:{}", "file://{}"])
def test_a_capture_has_two_spellings(tmp_path, url_pattern):
    path = tmp_path / "a.bin"
    CaptureWriter(path, {"baud": 500_000}).close()
    link = open_link(url_pattern.format(path))
    assert isinstance(link, CaptureLink)
    assert (link.baud, link.is_real_time, link.is_recorded) == (5e5, False, True)
    link.close()


def test_a_capture_can_be_named_by_a_relative_path(tmp_path, monkeypatch):
    CaptureWriter(tmp_path / "a.bin").close()
    monkeypatch.chdir(tmp_path)
    open_link("file:a.bin").close()


@pytest.mark.parametrize("url", ["", "x", "capture.bin", "emulator", "EMULATOR:", "COM3"])
def test_the_error_for_an_unknown_url_lists_the_supported_schemes(url):
    with pytest.raises(LinkError) as caught:
        taxel.open(url)
    text = read_single_line(caught.value)
    assert all(scheme in text for scheme in ("serial:", "emulator:", "file:"))


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("baud=fast", "baud"),
        ("baud=", "baud"),
        ("baud=nan", "baud"),
        ("baud=999", "baud"),
        ("baud=1e9", "baud"),
        ("rtscts=yes", "rtscts"),
        ("low_latency=2", "low_latency"),
        ("parity=odd", "parity"),
    ],
)
def test_the_error_for_an_invalid_serial_option_names_url_and_option(query, field):
    url = f"serial:///dev/ttyUSB0?{query}"
    with pytest.raises(LinkError) as caught:
        open_link(url)
    text = read_single_line(caught.value)
    assert text.startswith(url)
    assert f"'{field}'" in text


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("speed=fast", "speed"),
        ("speed", "speed"),
        ("seed=-1", "seed"),
        ("seed=1.5", "seed"),
        ("scl_hz=1", "scl_hz"),
        ("baud=x", "baud"),
        ("duration_s=nan", "duration_s"),
        ("duration_s=0", "duration_s"),
        ("threads=0", "threads"),
        ("threads=17", "threads"),
        ("threads=1.5", "threads"),
        ("noise_counts=inf", "noise_counts"),
        ("clock_spread_ppm=1e6", "clock_spread_ppm"),
        ("stimulus=", "stimulus"),
    ],
)
def test_the_error_for_an_invalid_emulator_option_names_url_and_option(query, field):
    url = f"emulator:?{query}"
    with pytest.raises(LinkError) as caught:
        taxel.open(url)
    text = read_single_line(caught.value)
    assert text.startswith(url)
    assert f"'{field}'" in text


def test_the_error_for_an_unknown_emulator_option_lists_all_options():
    with pytest.raises(LinkError) as caught:
        taxel.open("emulator:?hand=flat8")
    text = read_single_line(caught.value)
    assert "'hand'" in text
    assert all(option in text for option in EMULATOR_OPTIONS)


@pytest.mark.parametrize("url", ["emulator:speed=max", "emulator://host", "emulator:/a/b"])
def test_an_emulator_url_with_a_path_is_refused(url):
    with pytest.raises(LinkError, match="expected emulator:"):
        taxel.open(url)


@pytest.mark.parametrize(
    "url",
    [
        "serial://[", "emulator://[", "serial:", "serial://", "file:", "file:a\0b", "emulator:?stimulus=%00", "foo://x",
        "hwgrep://[", "hwgrep://no such port", "loop://?x=1", "socket://127.0.0.1", "socket://127.0.0.1:99999", "socket://",
        "rfc2217://127.0.0.1:99999", "serial:///dev/\0",
    ],
)  # fmt: skip
def test_every_malformed_url_raises_a_link_error_with_a_one_line_text(url):
    with pytest.raises(LinkError) as caught:
        taxel.open(url)
    assert not read_single_line(caught.value).startswith(":")  # the message begins with a name


@pytest.mark.parametrize("url", ["serial:///dev/ttyNOPE", "/dev/ttyNOPE", "serial://dev/ttyNOPE"])
def test_the_error_for_a_missing_port_names_the_port_as_written(url):
    with pytest.raises(PortMissingError) as caught:
        taxel.open(url)
    text = read_single_line(caught.value)
    assert url.removeprefix("serial:").removeprefix("//") in text
    assert "plugged in" in text


def test_the_error_for_a_missing_capture_names_the_file(tmp_path):
    with pytest.raises(CaptureError, match="cannot be read") as caught:
        taxel.open(f"file:{tmp_path / 'none.bin'}")
    assert read_single_line(caught.value).startswith(str(tmp_path / "none.bin"))


def test_a_folder_is_refused_as_a_capture(tmp_path):
    with pytest.raises(CaptureError, match="is a folder"):
        open_link(f"file:{tmp_path}")


def test_a_regular_file_is_refused_as_a_port(tmp_path):
    path = Path(tmp_path / "plain")
    path.write_bytes(b"")
    with pytest.raises(PortMissingError) as caught:
        open_link(f"serial://{path}")
    assert str(path) in read_single_line(caught.value)


def test_errors_of_links_can_be_pickled():
    for kind in (LinkError, PortMissingError, CaptureError):
        error = pickle.loads(pickle.dumps(kind("port", "is gone")))
        assert (type(error), error.name, error.problem, str(error)) == (kind, "port", "is gone", "port: is gone")
