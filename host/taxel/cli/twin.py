"""`taxel twin`."""

import json
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Protocol

import typer
from rich.console import Console

from taxel.cli.options import AsJson, HandCan, HandOption, JointAngles, JointFile, JointTopic, Overwrite, Seconds
from taxel.optional import require_packages

if TYPE_CHECKING:
    from taxel.ros.topics import TopicMessage
    from taxel.twin.schedule import ContactSchedule
    from taxel.twin.session import TwinSession, Update
    from taxel.twin.sources import Source

Reference = Annotated[
    Path,
    typer.Option(help="Grasp dataset of the healthy skin: repeated contacts (taxel grasp, taxel import)."),
]


class MessageSink(Protocol):
    """Receiver of ROS messages: an MCAP file or a ROS node."""

    def publish(self, message: "TopicMessage") -> None:
        """Write or send a message."""
        ...


def twin(
    url: Annotated[
        str, typer.Argument(help="The skin (serial:, emulator:, file:RECORDING), or a grasp dataset FILE.h5.")
    ],
    reference: Reference,
    contacts: Annotated[
        Path | None, typer.Option(help="CSV of announced contacts: closing_s,hold_s,...,object,approach.")
    ] = None,
    hand: HandOption = None,
    speed: Annotated[
        float | None, typer.Option(help="Speed of a recording, times real time. Default: maximum.")
    ] = None,
    false_alarm_hours: Annotated[
        float, typer.Option(min=0.1, max=1e6, help="Mean time to a false alarm of the whole skin, hours.")
    ] = 24.0,
    name_causes: Annotated[bool, typer.Option("--causes/--no-causes", help="Name the cause of alarms.")] = True,
    seconds: Seconds = None,
    web: Annotated[bool, typer.Option("--web", help="Show the twin in a browser, on this machine only.")] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the page. 0: a free port.")] = 0,
    repair: Annotated[
        bool,
        typer.Option(
            "--repair",
            help="Correct signals by the active alarms: dead taxels are interpolated, gains compensated. Topic "
            "/taxel/twin/repaired; raw counts are kept.",
        ),
    ] = False,
    simulate: Annotated[
        bool,
        typer.Option(
            "--simulate",
            help="Predict each contact with the simulator, at poses estimated from the contact, instead of with the "
            "mean of the reference's repeats.",
        ),
    ] = False,
    joints: JointAngles = None,
    joint_file: JointFile = None,
    joint_topic: JointTopic = None,
    hand_can: HandCan = None,
    object_poses: Annotated[
        Path | None,
        typer.Option(help="CSV of the object's poses: time_s,x_m,y_m,z_m,qw,qx,qy,qz. Default: the reference's."),
    ] = None,
    object_topic: Annotated[
        str | None, typer.Option(help="Topic of type geometry_msgs/PoseStamped with the object's pose.")
    ] = None,
    record: Annotated[
        Path | None, typer.Option(help="MCAP file for the topics of the twin: frames, events, diagnostics (extra ros).")
    ] = None,
    ros: Annotated[bool, typer.Option("--ros", help="Publish the topics of the twin (needs rospy or rclpy).")] = False,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Compare a skin with its reference, and report changes with their time, place and cause.

    The reference contains repeated contacts of the healthy skin. Each contact of the stream that the CSV file announces
    is compared with the contacts of the same object and approach; without announced contacts only the state at rest is
    compared. An alarm states a change that the reference does not explain.

    With --simulate, the reference shows how far the simulator is wrong, and the poses of each contact start from the
    joint angles and object poses of the options, of the recording, or of the reference.

    Example: taxel twin today.h5 --reference healthy.h5 --json
    """
    require_packages("taxel twin", "gap", "h5py", "jinja2")
    from taxel.cli.twin_poses import PoseOptions, SimulatorMode
    from taxel.twin import Twin, read_reference
    from taxel.twin.causes import ReferenceFile
    from taxel.twin.naming import CauseNaming
    from taxel.twin.session import TwinSession

    console = Console(stderr=True, markup=False)
    poses = PoseOptions(joints, joint_file, joint_topic, hand_can, object_poses, object_topic)
    poses.require_simulation(simulate)
    known = read_reference(reference)
    with _open_source(url, hand, speed, contacts, reference) as (source, schedule):
        naming = CauseNaming(ReferenceFile.read(reference), source.is_live) if name_causes else None
        with console.status("learning the reference") if console.is_terminal else nullcontext():
            simulator = SimulatorMode(reference, known, url, source, hand, poses) if simulate else None
            watched = Twin(simulator.reference if simulator else known, schedule, false_alarm_hours)
        session = TwinSession(watched, source, naming, repair)
        try:
            with ExitStack() as stack:
                if simulator is not None:
                    simulator.start(session, stack)
                sinks = _open_sinks(stack, record, ros, overwrite, f"{url}, reference {reference}")
                limited = _limit_duration(session.updates(), seconds)
                updates = _publish_updates(limited, session, sinks, source.is_live)
                _show_updates(updates, session, console, url, web, port, as_json)
        except KeyboardInterrupt:
            return  # Ctrl-C is the usual end


def _show_updates(
    updates: Iterator["Update"],
    session: "TwinSession",
    console: Console,
    url: str,
    web: bool,
    port: int,
    as_json: bool,
) -> None:
    """Show the updates of the twin until their end.

    In a browser with `web`; as printed lines with `as_json` or if standard error is no terminal; else as a live view on
    the terminal. port: port of the page.
    """
    if web:
        _show_in_browser(updates, session, port, as_json)
    elif as_json or not console.is_terminal:
        _print_events(updates, as_json)
    else:
        from taxel.twin.terminal import show_on_terminal

        show_on_terminal(updates, session, console, url)


def _open_sinks(stack: ExitStack, record: Path | None, ros: bool, overwrite: bool, title: str) -> list[MessageSink]:
    """Open the requested receivers of messages, which the stack closes.

    record: MCAP file; None: no file. ros: whether to open a ROS node. title: source of the messages in the header of
    the file.
    """
    sinks: list[MessageSink] = []
    if record is not None:
        from taxel.ros.mcap_file import McapFile

        file = McapFile(record, {"program": "taxel twin", "source": title}, overwrite)
        stack.callback(file.close)
        sinks.append(file)
    if ros:
        from taxel.ros.node import open_node

        node = open_node()
        stack.callback(node.close)
        sinks.append(node)
    return sinks


def _publish_updates(
    updates: Iterator["Update"], session: "TwinSession", sinks: list[MessageSink], is_live: bool
) -> Iterator["Update"]:
    """Yield the updates, each after its messages have been passed to all receivers.

    is_live: the times of the messages are Unix times; otherwise those of the recording.
    """
    if not sinks:
        yield from updates
        return
    from taxel.twin.topics import TwinTopics

    sensors = session.twin.reference.sensors
    boards = dict(zip(sensors.address.tolist(), sensors.name, strict=True))
    offset_ns = time.time_ns() - time.monotonic_ns() if is_live else 0
    topics = TwinTopics(boards, offset_ns)
    for update in updates:
        for message in topics.make(update, session.twin.active.values()):
            for sink in sinks:
                sink.publish(message)
        yield update


@contextmanager
def _open_source(
    url: str, hand: str | None, speed: float | None, contacts: Path | None, reference: Path
) -> Iterator[tuple["Source", "ContactSchedule"]]:
    """Context manager: (source of frames, schedule of announced contacts) for a skin or a grasp dataset.

    contacts: file of the announced contacts; None: those of the dataset, or none for a skin. reference: dataset of the
    healthy skin, to which a skin must fit. Raises TaxelError.
    """
    from taxel.monitor import open_paced
    from taxel.monitor.paced_link import SPEED_MAX
    from taxel.twin import ContactSchedule, read_reference, read_schedule
    from taxel.twin.sources import DatasetSource, SkinSource

    schedule = ContactSchedule() if contacts is None else read_schedule(contacts)
    if url.endswith((".h5", ".hdf5")) and ":" not in url:
        dataset = DatasetSource.read(url)
        yield dataset, schedule if contacts is not None else dataset.schedule
        return
    is_recorded = url.startswith("file:")
    with open_paced(url, hand, None, (speed or SPEED_MAX) if is_recorded else 1.0) as skin:
        source = SkinSource(skin)
        known = read_reference(reference)
        source.check(known.taxels, known.sensors, str(reference))
        yield source, schedule


def _limit_duration(updates: Iterator["Update"], seconds: float | None) -> Iterator["Update"]:
    """Yield updates for `seconds` of real time; None: all."""
    started = time.monotonic()
    for update in updates:
        yield update
        if seconds is not None and time.monotonic() - started >= seconds:
            return


def _print_events(updates: Iterator["Update"], as_json: bool) -> None:
    """Print each event on a line, and at the end the numbers of compared steps and alarms unless `as_json`."""
    steps = alarms = skipped = 0
    for update in updates:
        steps += len(update.results)
        skipped += update.skipped
        for event in update.events:
            text = event.to_json()
            alarms += text["event"] == "alarm"
            print(json.dumps(text, allow_nan=False) if as_json else str(event), flush=True)
    if not as_json:
        print(f"{steps} steps compared, {alarms} alarms" + (f", {skipped} frames not shown" if skipped else ""))


def _show_in_browser(updates: Iterator["Update"], session: "TwinSession", port: int, as_json: bool) -> None:
    """Serve the page of the twin until Ctrl-C, and print each event."""
    from taxel.twin.web import TwinPage

    with TwinPage(session, port) as page:
        print(f"the twin is at {page.url}; press Ctrl-C to quit", flush=True)
        _print_events(page.follow(updates), as_json)
        page.wait()
