"""The skin as ROS messages: definitions, CDR, MCAP files, and nodes of ROS 1 and ROS 2."""

from taxel.ros.mcap_file import McapFile
from taxel.ros.mcap_link import McapLink, is_mcap, open_mcap
from taxel.ros.topics import SkinTopics, TopicMessage

__all__ = ["McapFile", "McapLink", "SkinTopics", "TopicMessage", "is_mcap", "open_mcap"]
