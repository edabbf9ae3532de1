"""Write the raw counts of a capture to a ROS 2 bag: python frames_to_bag.py skin.bin skin_bag."""

import sys
from pathlib import Path

from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from taxel.stream import CaptureDecoder

PACKAGE = Path(__file__).parents[1] / "taxel_hub_msgs"
types = get_typestore(Stores.ROS2_HUMBLE)
types.register(get_types_from_msg((PACKAGE / "msg/TaxelFrame.msg").read_text(), "taxel_hub_msgs/msg/TaxelFrame"))
frame_type, header_type = types.types["taxel_hub_msgs/msg/TaxelFrame"], types.types["std_msgs/msg/Header"]

with Writer(sys.argv[2], version=9) as bag:
    topic = bag.add_connection("/taxel_frames", frame_type.__msgtype__, typestore=types)
    for batch, arrivals in CaptureDecoder(sys.argv[1]):
        for row in batch.taxel_rows:
            time_ns = int(arrivals["time_ns"][min((arrivals["end"] < row["stream_position"]).sum(), len(arrivals) - 1)])
            stamp = types.types["builtin_interfaces/msg/Time"](time_ns // 10**9, time_ns % 10**9)
            numbers = (int(row[name]) for name in ("sequence", "lost_before", "address", "cycle", "hub_time_us",
                       "board_sequence", "board_time_us", "missing_before"))  # fmt: skip
            flags = (not row["flags"] & 1, bool(row["flags"] & 4))
            counts = batch.counts[row["offset"] : row["offset"] + row["size"]]
            message = frame_type(header_type(stamp, f"{row['address']:#04x}"), *numbers, *flags, counts)
            bag.write(topic, time_ns, types.serialize_cdr(message, frame_type.__msgtype__))
