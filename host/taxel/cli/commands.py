"""The commands of `taxel`: names, summaries, panels of the help page, and the modules that implement them.

The help page and shell completion are built from this table alone, so that they import no command.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, NamedTuple


class CommandEntry(NamedTuple):
    """One command or group of commands.

    target: "module:attribute" of a typer function or a `typer.Typer` group; "" for a command of a package that depends
    on this one and adds the command by an entry point of the group `taxel.commands`. summary: first line of the
    command's help text. panel: heading above the command on the help page. extra: name of the extra (optional group of
    dependencies) that installs all libraries of the command; None: an error message names the extra of the missing
    library.
    """

    target: str
    summary: str
    panel: str
    extra: str | None = None


START: Final = "Start here"
SKIN: Final = "Read a skin"
BOARDS: Final = "Sensor boards"
GRASPS: Final = "Grasp datasets"
ANALYSIS: Final = "Analysis"
OTHER: Final = "Commands of other packages"

COMMANDS: Final[Mapping[str, CommandEntry]] = MappingProxyType(
    {
        "demo": CommandEntry(
            "taxel.cli.demo:demo",
            "Diagnose a sealed cause on the emulated hand, and compare the diagnosis with the cause.",
            START,
            extra="all",
        ),
        "feel": CommandEntry(
            "taxel.cli.feel:feel",
            "Apply scripted contacts and measured touches to the emulated skin, and show the active taxels.",
            START,
            extra="plots",
        ),
        "monitor": CommandEntry(
            "taxel.cli.monitor:monitor", "Show a skin live, in the terminal or in a browser.", SKIN
        ),
        "proximity": CommandEntry(
            "taxel.cli.proximity:proximity_app",
            "Estimate distance and speed of a target before it touches the skin.",
            SKIN,
        ),
        "record": CommandEntry("taxel.cli.record:record", "Record a skin to a file.", SKIN),
        "replay": CommandEntry(
            "taxel.cli.replay:replay", "Summarise a recording, or play it into a serial port, ROS or a file.", SKIN
        ),
        "twin": CommandEntry(
            "taxel.cli.twin:twin",
            "Compare a skin with its reference, and report changes with their time, place and cause.",
            SKIN,
            extra="gap",
        ),
        "convert": CommandEntry("taxel.cli.convert:convert", "Convert a recording to another file format.", SKIN),
        "emulate": CommandEntry(
            "taxel.cli.emulate:emulate", "Run the emulated skin behind a virtual serial port.", SKIN
        ),
        "ros": CommandEntry("taxel.cli.ros:ros", "Publish a skin as ROS topics.", SKIN, extra="ros"),
        "ros-hand": CommandEntry(
            "taxel.cli.ros_hand:ros_hand",
            "Control the Allegro hand from ROS: joint commands in, measured joint angles out.",
            SKIN,
            extra="ros",
        ),
        "bringup": CommandEntry(
            "", "Test the first board with the bring-up image, and compare it with the firmware's assumptions.", BOARDS
        ),
        "scan": CommandEntry("", "List the boards on the bus.", BOARDS),
        "provision": CommandEntry(
            "",
            "Assign address, kind, serial number and calibration to boards.",
            BOARDS,
        ),
        "flash": CommandEntry("", "Program the firmware of boards or hub.", BOARDS),
        "keygen": CommandEntry("", "Generate a key pair for signatures of firmware.", BOARDS, extra="sign"),
        "sign": CommandEntry("", "Sign firmware files.", BOARDS, extra="sign"),
        "bench": CommandEntry("", "Test a sensor board on a test bench.", BOARDS, extra="bench"),
        "grasp": CommandEntry(
            "taxel.cli.grasp:grasp",
            "Run the 144 grasps of the thesis on the emulated hand, in the simulator or on a physical hand.",
            GRASPS,
            extra="sim",
        ),
        "show": CommandEntry(
            "taxel.cli.show:show",
            "Draw a grasp dataset, or check the physics of a simulated one.",
            GRASPS,
            extra="sim",
        ),
        "import": CommandEntry(
            "taxel.cli.import_data:import_app",
            "Import contacts, rollouts or arrays of other programs as a grasp dataset.",
            GRASPS,
            extra="sim",
        ),
        "generate": CommandEntry(
            "taxel.cli.generate:generate", "Generate synthetic grasps at scale.", GRASPS, extra="sim"
        ),
        "gap": CommandEntry(
            "taxel.cli.gap:gap_app",
            "Diagnose the gap between simulator and hand: location, cause, and reduction.",
            ANALYSIS,
            extra="gap",
        ),
        "cloud": CommandEntry(
            "taxel.cli.cloud:cloud_app",
            "Filter, align, measure and match contact clouds.",
            ANALYSIS,
            extra="cloud",
        ),
        "thesis": CommandEntry(
            "taxel.cli.thesis:thesis",
            "Reproduce the tables and figures of the thesis, and compare them with the printed ones.",
            ANALYSIS,
            extra="all",
        ),
    }
)
"""The project's commands, in the order in which a user first needs them."""
