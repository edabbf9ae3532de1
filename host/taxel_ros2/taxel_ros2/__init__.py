"""ROS 2 package of a tactile skin."""
