"""The filter on a robot that speaks ROS 2; all but the node itself is plain Python."""
