"""Options that have a new name: an old name is refused with one line that gives the new one."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

from taxel.errors import TaxelError

RENAMED: Final[Mapping[str, Mapping[str, str]]] = MappingProxyType(
    {
        "cloud align": {"--sampled": "--sample-mesh"},
        "cloud filter": {"--threshold": "--threshold-counts"},
        "cloud make": {"--least-share": "--min-share", "--threshold": "--threshold-counts"},
        "cloud match": {"--threshold": "--threshold-counts", "--draws": "--resamples"},
        "convert": {"--joints": "--joint-angles"},
        "emulate": {"--noise": "--noise-counts"},
        "gap blind": {"--also": "--add-answers", "--full-hand": "--full-hand-worlds"},
        "gap next": {"--candidates": "--candidate"},
        "generate": {"--effects": "--gap-report", "--shard": "--grasps-per-shard", "--workers": "--jobs"},
        "grasp": {"--effects": "--effect", "--objects": "--object"},
        "import active": {
            "--joints": "--joint-file",
            "--poses": "--pose-file",
            "--noise": "--noise-counts",
            "--wrist": "--wrist-pose",
        },
        "import gazebo": {
            "--joints": "--joint-file",
            "--poses": "--pose-file",
            "--noise": "--noise-counts",
            "--wrist": "--wrist-pose",
            "--threshold-mm": "--distance-mm",
        },
        "import rollout": {"--noise": "--noise-counts"},
        "monitor": {"--baseline": "--baseline-frames", "--rate": "--rate-hz", "--threshold": "--threshold-counts"},
        "provision": {"--address": "--new-address", "--at": "--board"},
        "record": {"--joints": "--joint-angles"},
        "replay": {"--joints": "--joint-angles"},
        "ros": {"--joints": "--joint-angles", "--ros": "--ros-version"},
    }
)
"""New name of each renamed option, by command."""


def refuse_renamed(arguments: Sequence[str]) -> None:
    """Raise `TaxelError` for the first argument that is a former name of an option of its command.

    arguments: the command line after the name of the program.
    """
    for length in (1, 2):
        command = " ".join(arguments[:length])
        for argument in arguments[length:]:
            name = argument.partition("=")[0]
            if name in RENAMED.get(command, {}):
                raise TaxelError(f"{command}: the option {name} is now named {RENAMED[command][name]}")
