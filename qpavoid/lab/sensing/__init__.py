"""Sensors of the world and of the robot's own state, and wheels."""
