"""A ROS 1 subscriber, run by the system's Python. Prints the received messages as JSON after its input is closed."""

import json
import struct
import sys
import threading

import genpy.dynamic
import rospy
import tf2_ros
from sensor_msgs.msg import JointState, PointCloud2

received = {"clouds": [], "scans": {}, "joints": [], "transforms": {}}
classes = {}
generation = threading.Lock()  # each topic has its own thread, and genpy generates one class at a time only


def store_cloud(message):
    """Store the first seven floats of every point."""
    points = [message.data[start : start + 28] for start in range(0, len(message.data), message.point_step)]
    received["clouds"].append([struct.unpack("<7f", point) for point in points])


def store_scan(message):
    """Store a message of any type. The class is generated from the connection header, as rostopic and rosbag do."""
    header = message._connection_header
    type_name = header["type"]
    with generation:
        if type_name not in classes:
            classes[type_name] = genpy.dynamic.generate_dynamic(type_name, header["message_definition"])[type_name]
    scan = classes[type_name]().deserialize(message._buff)
    if scan.valid:
        received["scans"].setdefault(header["topic"], []).append([scan.sequence, *scan.raw_counts])


def main():
    """Listen until standard input is closed."""
    rospy.init_node("listener", disable_signals=True)
    buffer = tf2_ros.Buffer()
    tf2_ros.TransformListener(buffer)
    rospy.Subscriber("/taxel/contact_cloud", PointCloud2, store_cloud)
    rospy.Subscriber("/joint_states", JointState, lambda message: received["joints"].append(list(message.position)))
    for topic in sys.argv[1].split(","):
        rospy.Subscriber(topic, rospy.AnyMsg, store_scan)
    print("ready", flush=True)
    sys.stdin.read()
    for frame in sys.argv[2].split(","):
        transform = buffer.lookup_transform("world", frame, rospy.Time(0)).transform
        t, q = transform.translation, transform.rotation
        received["transforms"][frame] = [t.x, t.y, t.z, q.w, q.x, q.y, q.z]
    received["topics"] = sorted(name for name, _ in rospy.get_published_topics())
    print(json.dumps(received), flush=True)


main()
