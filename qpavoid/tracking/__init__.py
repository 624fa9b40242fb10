"""Where the robot is meant to be: planned paths (Eq. 2, 3) and tracking (Eq. 6)."""
