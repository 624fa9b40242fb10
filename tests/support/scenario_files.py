"""Scenario files that several tests run."""

CROSSING = """
title = "A disc crosses the way"
duration_s = 4.0
dt_s = 0.05
frames_s = [0.0, 1.5, 3.0]
[reference]
kind = "cubic"
start = { x_m = 0.0, y_m = 0.0 }
goal = { x_m = 2.0, y_m = 0.5 }
k_m = 2.0
duration_s = 4.0
"""

SLOW = """
[[obstacles]]
kind = "disc"
position_m = [1.3, 0.7]
velocity_mps = [0.0, -0.08]
"""
