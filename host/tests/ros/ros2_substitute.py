"""A substitute for rclpy, launch and the message packages, with the functions that the ROS 2 package uses."""

import types
from typing import Any


class Message(types.SimpleNamespace):
    """A message object: any fields."""


class MessagePackage(types.ModuleType):
    """A module such as std_msgs.msg with a class for every name."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (Message,), {})


class LifecycleNode:
    """The part of rclpy.lifecycle.LifecycleNode that a node with a thread needs; transitions are called directly."""

    instances: list["LifecycleNode"] = []  # noqa: RUF012 - one list for all tests, emptied by the fixture

    def __init__(self, name: str) -> None:
        self.name, self.state = name, "unconfigured"
        self.published: list[tuple[str, Any, Message]] = []
        self.declared: dict[str, Any] = {}
        self.values: dict[str, Any] = {}
        self.services: dict[str, Any] = {}
        self.timers: list[Any] = []
        self.log: list[str] = []
        self.instances.append(self)

    def declare_parameter(self, name: str, default: Any, descriptor: Message) -> None:
        self.declared[name] = descriptor
        self.values[name] = default

    def get_parameter(self, name: str) -> Message:
        return Message(value=self.values[name])

    def get_logger(self) -> Any:
        return types.SimpleNamespace(error=self.log.append, info=self.log.append)

    def create_publisher(self, message_class: Any, topic: str, profile: Any) -> Any:
        return types.SimpleNamespace(
            publish=lambda message: self.published.append((topic, profile.durability, message))
        )

    def create_subscription(self, message_class: Any, topic: str, callback: Any, depth: int) -> Any:
        """Deliver one message with the angle of one joint immediately."""
        callback(Message(name=["elbow"], position=[0.5]))
        return object()

    def create_service(self, service_class: Any, name: str, callback: Any) -> str:
        self.services[name] = callback
        return name

    def create_timer(self, period_s: float, callback: Any) -> Any:
        self.timers.append(callback)
        return callback

    def destroy_publisher(self, publisher: Any) -> None:
        pass

    def destroy_subscription(self, subscription: Any) -> None:
        pass

    def destroy_service(self, service: str) -> None:
        del self.services[service]

    def destroy_timer(self, timer: Any) -> None:
        self.timers.remove(timer)

    def destroy_node(self) -> None:
        pass

    def on_activate(self, state: Any) -> str:
        return "SUCCESS"

    def on_deactivate(self, state: Any) -> str:
        return "SUCCESS"

    def trigger_deactivate(self) -> None:
        """Run the transition from active to inactive, which must succeed."""
        assert self.state == "active"
        assert self.on_deactivate(None) == "SUCCESS"
        self.state = "inactive"

    def change_state(self, transition: str) -> bool:
        """Run a transition as the state machine of ROS does; returns whether it succeeded."""
        goal = {"configure": "inactive", "activate": "active", "deactivate": "inactive", "cleanup": "unconfigured"}
        has_succeeded: bool = getattr(self, f"on_{transition}")(None) == "SUCCESS"
        if has_succeeded:
            self.state = goal[transition]
        return has_succeeded


def make_modules() -> dict[str, types.ModuleType]:
    """Make the substitute modules by name, for sys.modules."""
    names = ("rclpy", "rclpy.qos", "rclpy.lifecycle", "rclpy.executors", "std_srvs.srv")
    modules = {name: types.ModuleType(name) for name in names}
    modules["rclpy.qos"].DurabilityPolicy = types.SimpleNamespace(TRANSIENT_LOCAL="latched", VOLATILE="volatile")
    modules["rclpy.qos"].QoSProfile = lambda **options: types.SimpleNamespace(**options)
    modules["rclpy.lifecycle"].LifecycleNode = LifecycleNode
    modules["rclpy.lifecycle"].TransitionCallbackReturn = types.SimpleNamespace(SUCCESS="SUCCESS", FAILURE="FAILURE")
    modules["rclpy.executors"].ExternalShutdownException = type("ExternalShutdownException", (Exception,), {})
    modules["rclpy"].init = modules["rclpy"].try_shutdown = lambda: None
    modules["std_srvs.srv"].Trigger = type("Trigger", (), {})
    packages = ("builtin_interfaces", "rcl_interfaces", "std_msgs", "sensor_msgs", "geometry_msgs", "tf2_msgs")
    for package in (*packages, "diagnostic_msgs", "taxel_msgs"):
        modules[f"{package}.msg"] = MessagePackage(f"{package}.msg")
    return modules
