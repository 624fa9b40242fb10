"""Perception: from scans and odometry to static and moving obstacles."""
