"""Robot, footprint, obstacles, contacts and kinematics: geometry, no laws."""
