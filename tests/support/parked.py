"""Scenarios of a parked robot."""

PARKED = """
title = "Parked beside a disc"
duration_s = 10.0
dt_s = 0.02
[reference]
kind = "station"
pose = { x_m = 0.0, y_m = 0.0 }
[robot]
acceleration_mps2 = 2.0
angular_acceleration_radps2 = 2.5
[tracking]
station_keeping = true
[margins]
error_m = 0.02
acceleration_mps2 = 1.0
[[obstacles]]
kind = "disc"
position_m = [2.5, 0.1]
radius_m = 0.25
[[obstacles]]
kind = "wall"
start_m = [-3.0, -4.0]
end_m = [3.0, -4.0]
"""

BESIDE = (2.5, 0.1)
