"""A subscriber of ROS 1, run by the system's Python: what it has heard, as JSON, once its standard input is closed."""

import json
import struct
import sys

import genpy.dynamic
import rospy
import tf2_ros
from sensor_msgs.msg import JointState, PointCloud2

heard = {"clouds": [], "scans": {}, "joints": [], "transforms": {}}
classes = {}


def take_cloud(message):
    """The first floats of every point."""
    points = [message.data[at : at + 28] for at in range(0, len(message.data), message.point_step)]
    heard["clouds"].append([struct.unpack("<7f", point) for point in points])


def take_scan(message):
    """Any message: its class is made from what the connection says, as rostopic and rosbag do."""
    header = message._connection_header
    kind = header["type"]
    if kind not in classes:
        classes[kind] = genpy.dynamic.generate_dynamic(kind, header["message_definition"])[kind]
    scan = classes[kind]().deserialize(message._buff)
    if scan.valid:
        heard["scans"].setdefault(header["topic"], []).append([scan.sequence, *scan.raw_counts])


def main():
    """Listen until nobody wants to know more."""
    rospy.init_node("listener", disable_signals=True)
    buffer = tf2_ros.Buffer()
    tf2_ros.TransformListener(buffer)
    rospy.Subscriber("/taxel/contact_cloud", PointCloud2, take_cloud)
    rospy.Subscriber("/joint_states", JointState, lambda message: heard["joints"].append(list(message.position)))
    for topic in sys.argv[1].split(","):
        rospy.Subscriber(topic, rospy.AnyMsg, take_scan)
    print("ready", flush=True)
    sys.stdin.read()
    for frame in sys.argv[2].split(","):
        found = buffer.lookup_transform("world", frame, rospy.Time(0)).transform
        t, q = found.translation, found.rotation
        heard["transforms"][frame] = [t.x, t.y, t.z, q.w, q.x, q.y, q.z]
    heard["topics"] = sorted(name for name, _ in rospy.get_published_topics())
    print(json.dumps(heard), flush=True)


main()
