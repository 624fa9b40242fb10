"""ROS 2 interface of the filter; all but the node itself is plain Python."""
