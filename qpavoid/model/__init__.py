"""Robot, footprint, obstacles, contacts and kinematics: geometry without any law."""
