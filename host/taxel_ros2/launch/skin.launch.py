"""Start the skin node, configure it and activate it: ros2 launch taxel_ros2 skin.launch.py url:=serial:///dev/ttyUSB0"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from lifecycle_msgs.msg import Transition


def generate_launch_description() -> LaunchDescription:
    """Return the launch description; the arguments have precedence over the parameter file."""
    default_file = Path(get_package_share_directory("taxel_ros2")) / "config" / "skin.yaml"
    node = LifecycleNode(
        package="taxel_ros2",
        executable="skin_node",
        name="taxel_skin",
        namespace=LaunchConfiguration("namespace"),
        parameters=[LaunchConfiguration("parameters"), {"url": LaunchConfiguration("url")}],
        output="screen",
    )
    configure, activate = (
        EmitEvent(event=ChangeState(lifecycle_node_matcher=matches_action(node), transition_id=transition))
        for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)
    )
    return LaunchDescription(
        [
            DeclareLaunchArgument("url", default_value="emulator:?speed=real", description="source of the frames"),
            DeclareLaunchArgument("namespace", default_value="", description="namespace of the node"),
            DeclareLaunchArgument("parameters", default_value=str(default_file), description="parameter file"),
            node,
            # Activated only from the transition configuring -> inactive: a node that was deactivated stays inactive.
            RegisterEventHandler(
                OnStateTransition(
                    target_lifecycle_node=node, start_state="configuring", goal_state="inactive", entities=[activate]
                )
            ),
            configure,
        ]
    )
