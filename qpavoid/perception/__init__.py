"""Perception: from range scans and odometry to static and moving obstacles."""
