"""ROS bags: which topics hold numbers, and the frames of chosen ones; by the library rosbags, without ROS.

A bag is a ``.bag`` of ROS 1, a ``.db3`` or ``.mcap`` of ROS 2, or a folder with ``metadata.yaml`` and its files.
"""

from taxel.formats.ros.bag import is_bag
from taxel.formats.ros.listing import Topic, topics
from taxel.formats.ros.reading import Topics, read_ros

__all__ = ["Topic", "Topics", "is_bag", "read_ros", "topics"]
