"""Parameters of the skin node, with the descriptions that `ros2 param describe` prints."""

from dataclasses import dataclass
from typing import Any, Final

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

URL: Final = "Source of the frames: serial:///dev/ttyUSB0, i2c:///dev/i2c-1, emulator:, file:skin.bin"


@dataclass(frozen=True)
class SkinParameters:
    """Values of the node's parameters, as read at the transition `configure`.

    url: source of the frames. hand: name or file of a hand description; "": that of the source. joint_topic: topic of
    sensor_msgs/JointState with the joint angles; "": all angles are 0 and the node publishes /joint_states.
    baseline_frames: number of first scans that form the baseline. threshold_counts: signal from which a taxel is
    active, counts. proximity_file: calibration of `taxel proximity calibrate`; "": targets before contact are not
    estimated.
    """

    url: str
    hand: str
    joint_topic: str
    baseline_frames: int
    threshold_counts: float
    proximity_file: str


def declare_parameters(node: Any) -> None:
    """Declare all parameters of a node with defaults, ranges and descriptions.

    A changed value takes effect at the next transition `configure`.
    """
    for name, default, description, limits in (
        ("url", "emulator:?speed=real", URL, {}),
        ("hand", "", "Name or file of a hand description; empty: the hand of a recording, else the original hand", {}),
        (
            "joint_topic",
            "",
            "Topic with the joint angles of the robot (sensor_msgs/JointState); empty: all angles 0",
            {},
        ),
        (
            "baseline_frames",
            100,
            "Number of first scans that form the baseline; nothing may touch the skin meanwhile",
            {"integer_range": [IntegerRange(from_value=1, to_value=100_000, step=1)]},
        ),
        (
            "threshold_counts",
            150.0,
            "Signal in counts from which a taxel is active",
            {"floating_point_range": [FloatingPointRange(from_value=1.0, to_value=65_535.0, step=0.0)]},
        ),
        ("proximity_file", "", "Calibration of taxel proximity calibrate; empty: no estimates before contact", {}),
    ):
        node.declare_parameter(name, default, ParameterDescriptor(description=description, **limits))


def read_parameters(node: Any) -> SkinParameters:
    """Return the present values of the parameters of a node."""
    names = SkinParameters.__dataclass_fields__
    return SkinParameters(**{name: node.get_parameter(name).value for name in names})
