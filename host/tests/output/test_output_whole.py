"""Files and folders that appear when they are complete; live recordings; locks."""

import os
import signal
import stat
import subprocess
import sys
import textwrap

import pytest

from taxel.output import (
    AppendedLines,
    LiveOutput,
    OutputError,
    PendingOutput,
    open_whole,
    read_complete_lines,
    whole_folder,
    whole_path,
    write_whole,
)
from taxel.skin.recorder import open_recorded

LOCKED = f"found one that process {os.getpid()} is writing"


def list_names(folder):
    """List the relative paths of all files and folders below a folder, also hidden ones."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_an_exception_while_a_file_is_written_leaves_the_old_file_and_no_other(tmp_path):
    write_whole(tmp_path / "x", "old")

    def write():
        with open_whole(tmp_path / "x") as file:
            file.write(b"new")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert (tmp_path / "x").read_text() == "old"
    assert list_names(tmp_path) == ["x"]


def test_missing_folders_are_created_and_after_an_error_removed_again(tmp_path):
    write_whole(tmp_path / "a" / "b" / "x", "new")
    with pytest.raises(ValueError, match="stop"), whole_path(tmp_path / "c" / "d" / "x"):
        raise ValueError("stop")
    assert list_names(tmp_path) == ["a", "a/b", "a/b/x"]


def test_a_folder_is_replaced_in_one_step(tmp_path):
    for name in ("one", "two"):
        with whole_folder(tmp_path / "out") as folder:
            (folder / name).write_text(name)
    assert list_names(tmp_path) == ["out", "out/two"]


def test_a_folder_created_meanwhile_is_not_overwritten(tmp_path):
    pending = PendingOutput(tmp_path / "out", overwrite=False, is_folder=True)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "other").write_text("")
    with pytest.raises(OutputError, match="found an existing one"):
        pending.commit()
    assert list_names(tmp_path) == ["out", "out/other"]


def test_permissions_of_a_replaced_file_are_kept(tmp_path):
    path = tmp_path / "x"
    path.write_text("old")
    path.chmod(0o640)
    write_whole(path, "new")
    assert stat.S_IMODE(path.stat().st_mode) == 0o640


def test_a_symbolic_link_is_kept_and_its_destination_is_replaced(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to("folder/x")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "folder" / "x").read_text() == "new"


def test_a_device_is_written_and_not_replaced(tmp_path):
    write_whole("/dev/null", "nothing")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    with pytest.raises(OutputError, match="expected a regular file, found a device or pipe"):
        PendingOutput("/dev/null", overwrite=True)


def test_a_file_with_the_longest_possible_name_can_be_written(tmp_path):
    longest_name = "x" * 255
    write_whole(tmp_path / longest_name, "new")
    assert list_names(tmp_path) == [longest_name]


def test_a_second_writer_is_refused_with_the_process_id_of_the_first(tmp_path):
    with open_whole(tmp_path / "x") as file:
        file.write(b"first")
        with pytest.raises(OutputError, match=LOCKED):
            write_whole(tmp_path / "x", "second")
        with pytest.raises(OutputError, match=LOCKED):
            LiveOutput(tmp_path / "x", overwrite=True)
    assert (tmp_path / "x").read_text() == "first"
    with whole_folder(tmp_path / "out"), pytest.raises(OutputError, match=LOCKED):
        PendingOutput(tmp_path / "out", overwrite=True, is_folder=True)


def test_a_temporary_file_of_a_killed_program_is_replaced(tmp_path):
    (tmp_path / ".x.part").write_text("of a killed program")
    (tmp_path / ".out.part").mkdir()
    (tmp_path / ".out.part" / "file").write_text("of a killed program")
    write_whole(tmp_path / "x", "new")
    with whole_folder(tmp_path / "out"):
        pass
    assert list_names(tmp_path) == ["out", "x"]
    assert (tmp_path / "x").read_text() == "new"


def test_a_recording_without_records_does_not_replace_an_existing_one(tmp_path):
    write_whole(tmp_path / "x", "old")
    output = LiveOutput(tmp_path / "x", overwrite=True)
    output.file.write(b"heading")
    output.begin()  # publishes the file only if there is no file to replace
    assert (tmp_path / "x").read_text() == "old"
    output.discard()
    assert list_names(tmp_path) == ["x"]
    assert (tmp_path / "x").read_text() == "old"


def test_the_replaced_recording_is_kept_until_the_new_one_is_closed(tmp_path):
    write_whole(tmp_path / "x", "old")
    output = LiveOutput(tmp_path / "x", overwrite=True)
    output.file.write(b"record")
    output.publish()
    assert (tmp_path / "x").read_text() == "record"
    assert (tmp_path / ".x.previous").read_text() == "old"
    with pytest.raises(OutputError, match=LOCKED):
        LiveOutput.extend(tmp_path / "x")
    output.close()
    assert list_names(tmp_path) == ["x"]


def test_an_interrupted_recording_is_replaced_and_the_last_complete_recording_is_kept(tmp_path):
    write_whole(tmp_path / "x", "complete")
    for text in (b"interrupted", b"second"):
        output = LiveOutput(tmp_path / "x", overwrite=True)
        output.file.write(text)
        output.publish()
        output.fail()
    assert (tmp_path / ".x.previous").read_text() == "complete"
    assert (tmp_path / "x").read_text() == "second"


def test_an_incomplete_last_line_is_neither_read_nor_kept(tmp_path):
    path = tmp_path / "lines"
    path.write_text("first\n" + "incomplete" * 20_000)
    assert read_complete_lines(path) == ["first"]
    with AppendedLines(path) as file:
        file.append("second")
        with pytest.raises(OutputError, match=LOCKED):
            AppendedLines(path)
    assert path.read_text() == "first\nsecond\n"


# Program that runs `taxel convert ARGUMENTS`, and after the first frame prints "writing" and waits for a signal.
PROGRAM = """
    import sys, time
    from taxel.cli.main import main
    import taxel.cli.convert
    from taxel.recording.formats import conversion

    def stop(*_):
        print("writing", flush=True)
        time.sleep(60)

    conversion._convert_frames = lambda skin, sink, notes, progress: _wait(skin, sink)

    def _wait(skin, sink):
        try:
            with skin:
                sink.take(next(iter(skin)))
                stop()
        finally:
            sink.close(False)

    sys.argv = ["taxel", "convert", *sys.argv[1:]]
    main()
"""


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Path of a 0.5 s capture."""
    path = tmp_path_factory.mktemp("capture") / "source.bin"
    with open_recorded("emulator:?speed=max&duration_s=0.5", path, "flat8") as skin:
        for _ in skin:
            pass
    return path


def restore_interrupts():
    """Let SIGINT end this process again: a shell may start jobs with SIGINT ignored, which processes inherit."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", ["x.bin", "x.mcap", "x.h5", "x.csv"])
def test_a_signal_during_a_conversion_removes_the_temporary_file(tmp_path, capture, number, name):
    program = [sys.executable, "-c", textwrap.dedent(PROGRAM), str(capture), str(tmp_path / "new" / name)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(program, text=True, preexec_fn=restore_interrupts, **pipes) as process:
        assert process.stdout.readline() == "writing\n"
        assert list_names(tmp_path / "new")[0].startswith(f".{name}.part")
        process.send_signal(number)
        errors = process.communicate(timeout=30)[1]
    assert process.returncode == 130, errors  # an interrupted command, for both signals
    assert list_names(tmp_path) == []
