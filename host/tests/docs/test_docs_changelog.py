"""CHANGELOG.md lists every renamed option with its new name."""

from host.tests.docs.page_blocks import ROOT
from taxel.cli.renamed_options import RENAMED


def test_changelog_has_a_row_with_command_old_and_new_name_for_every_renamed_option():
    rows = [line for line in (ROOT / "CHANGELOG.md").read_text().splitlines() if line.startswith("| `taxel ")]
    for command, options in RENAMED.items():
        for old, new in options.items():
            assert any(
                f" `{old}` " in row and f" `{new}`" in row and (f"`taxel {command}`" in row or f"`{command}`" in row)
                for row in rows
            ), f"{command}: {old} -> {new}"
