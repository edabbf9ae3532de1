"""The example programs of the clients print the frames of a capture."""

import pytest

from host.tests.clients.conftest import captures, programs, reference, run_client


@pytest.mark.parametrize("language", programs.LANGUAGES)
def test_the_example_prints_one_line_for_each_taxel_frame(language, tmp_path, monkeypatch):
    captures.record_capture(tmp_path / "skin.bin", 0.5, "compact")
    monkeypatch.chdir(programs.CLIENTS / language)
    lines = run_client(language, str(tmp_path / "skin.bin"), name="print_frames")
    stream = reference.Stream("example", reference.TO_HOST, reference.read_stream(tmp_path / "skin.bin"))
    frames = [line for line in reference.format_stream(stream, has_wire=False) if "TAXELS" in line]
    expected = []
    for line in frames:
        words = dict(word.split("=") for word in line.split(" ")[1:])
        first = words["counts"].partition(",")[0]
        address, cycle = int(words["header_address"]), words["header_cycle"]
        expected.append(f"board 0x{address:02X}, cycle {cycle}: taxel 0 has {first} counts")
    assert lines == [*expected, "0 frames lost"]
