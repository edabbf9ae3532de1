"""Direction of the includes between the folders of the C code."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
FIRMWARE = ROOT / "firmware"
INCLUDE = re.compile(r'^#include "([^"]+)"', re.MULTILINE)
UNRESTRICTED = ("tests", "fuzz")  # test code may include every folder

PART_FOLDERS = ("boards/psoc4200/part", "boards/psoc4100s/part")
"""Folders that the include "part/..." can mean: the build of a part selects one."""

# A folder of firmware/, and the folders whose headers its files include. A folder stands below all folders that it
# includes. The README of a folder states the same names.
PERMITTED = {
    "generated": (),
    "hal": ("generated",),
    "codec": ("generated",),
    "sensor": ("codec", "hal", "generated"),
    "hub": ("codec", "hal", "generated"),
    "bootloader": ("codec", "hal", "generated"),
    "linux_hub": ("hub", "codec", "hal", "generated"),
    "boards/psoc4200/part": (),
    "boards/psoc4100s/part": (),
    "boards/psoc4/regs": PART_FOLDERS,
    "boards/psoc4": ("boards/psoc4/regs", *PART_FOLDERS, "sensor", "hub", "bootloader", "codec", "hal", "generated"),
    "boards/psoc4200": ("boards/psoc4", "boards/psoc4/regs", "boards/psoc4200/part", "generated"),
    "boards/psoc4100s": ("boards/psoc4", "boards/psoc4/regs", "boards/psoc4100s/part", "generated"),
    "boards/psoc4200/bringup": ("boards/psoc4", "boards/psoc4/regs", "boards/psoc4200/part", "generated"),
    "emulator/base": ("generated",),
    "emulator/cortex_m0": (),
    "emulator/psoc4": ("emulator/base", "emulator/cortex_m0"),
    "emulator/physics": ("emulator/base", "generated"),
    "emulator/geometry": ("emulator/physics", "emulator/base", "generated"),
    "emulator/effects": ("emulator/geometry", "emulator/physics", "emulator/base", "generated"),
    "emulator/original": ("emulator/geometry", "emulator/base", "hal", "generated"),
    "emulator/wiring": ("emulator/base",),
    "emulator/world_file": (
        "emulator/wiring",
        "emulator/psoc4",
        "emulator/original",
        "emulator/effects",
        "emulator/geometry",
        "emulator/physics",
        "emulator/base",
        "generated",
    ),
    "emulator/skin": (
        "emulator/wiring",
        "emulator/world_file",
        "emulator/original",
        "emulator/effects",
        "emulator/geometry",
        "emulator/physics",
        "emulator/base",
        "generated",
    ),
    "emulator/dynamics": ("emulator/skin", "emulator/geometry", "generated"),
    "emulator": (
        "emulator/wiring",
        "emulator/skin",
        "emulator/world_file",
        "emulator/original",
        "emulator/effects",
        "emulator/geometry",
        "emulator/physics",
        "emulator/psoc4",
        "emulator/base",
        "sensor",
        "hub",
        "bootloader",
        "codec",
        "hal",
        "generated",
    ),
}


def list_source_files() -> list[Path]:
    """List the C files of the firmware, except test code."""
    files = [path for path in FIRMWARE.rglob("*") if path.suffix in (".c", ".h")]
    return [path for path in files if path.relative_to(FIRMWARE).parts[0] not in UNRESTRICTED]


def get_top_folder(path: Path) -> str:
    """Return the folder of a file, relative to firmware/, such as "emulator/physics"."""
    return path.parent.relative_to(FIRMWARE).as_posix()


def list_included_headers(source: Path) -> list[Path]:
    """List the headers of the firmware that a source includes.

    Headers that the build writes have no folder in their name and are omitted.
    """
    names = INCLUDE.findall(source.read_text())
    of_parts = [Path(name).name for name in names if name.startswith("part/")]
    own = [folder for folder in PART_FOLDERS if source.is_relative_to(FIRMWARE / Path(folder).parent)]
    parts = [FIRMWARE / folder / name for folder in own or PART_FOLDERS for name in of_parts]
    return parts + [FIRMWARE / name for name in names if "/" in name and not name.startswith("part/")]


def test_every_folder_with_c_files_has_a_rule():
    assert {get_top_folder(path) for path in list_source_files()} == set(PERMITTED)


def test_a_folder_includes_only_permitted_folders():
    forbidden = [
        f"{source.relative_to(ROOT)} includes {header.relative_to(FIRMWARE)}"
        for source in list_source_files()
        for header in list_included_headers(source)
        if get_top_folder(header) not in (get_top_folder(source), *PERMITTED[get_top_folder(source)])
    ]
    assert forbidden == []


def test_every_included_header_exists():
    missing = [
        f"{source.relative_to(ROOT)} includes {header.relative_to(FIRMWARE)}"
        for source in list_source_files()
        for header in list_included_headers(source)
        if not header.is_file()
    ]
    assert missing == []


def test_permitted_includes_have_no_cycle():
    # Each pass adds the folders that include only finished folders; a folder in a cycle is never added.
    finished: set[str] = set()
    for _ in PERMITTED:
        finished |= {folder for folder, below in PERMITTED.items() if finished.issuperset(below)}
    assert finished == set(PERMITTED)


def test_internal_headers_are_included_only_in_their_folder():
    foreign = [
        f"{source.relative_to(ROOT)} includes {header.relative_to(FIRMWARE)}"
        for source in list_source_files()
        for header in list_included_headers(source)
        if "internal" in header.stem and header.parent != source.parent
    ]
    assert foreign == []


@pytest.mark.parametrize("folder", [folder for folder in PERMITTED if (FIRMWARE / folder / "README.md").is_file()])
def test_the_readme_names_every_permitted_folder(folder):
    text = (FIRMWARE / folder / "README.md").read_text()
    missing = [name for name in PERMITTED[folder] if not re.search(rf"\b{Path(name).name}\b", text)]
    assert missing == []
