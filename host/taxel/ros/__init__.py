"""ROS messages of the skin: definitions, CDR encoding, MCAP files, and nodes of ROS 1 and ROS 2.

`McapFile`, `McapLink` and `open_mcap` are imported on first use, because they need optional libraries.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from taxel.ros.mcap_signature import is_mcap
from taxel.ros.topics import SkinTopics, TopicMessage

if TYPE_CHECKING:
    from taxel.ros.mcap_file import McapFile
    from taxel.ros.mcap_link import McapLink, open_mcap

__all__ = ["McapFile", "McapLink", "SkinTopics", "TopicMessage", "is_mcap", "open_mcap"]

_MODULE_OF_NAME = {"McapFile": "mcap_file", "McapLink": "mcap_link", "open_mcap": "mcap_link"}


def __getattr__(name: str) -> Any:
    """Import the submodule that defines `name` on first use, and return the object with this name."""
    if name not in _MODULE_OF_NAME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULE_OF_NAME[name]}"), name)
