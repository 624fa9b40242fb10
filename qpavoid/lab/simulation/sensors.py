"""Sensors, localisation and plant of a simulated robot."""

import math
from collections.abc import Callable
from typing import TypeAlias

from qpavoid.lab.sensing.clusters import ClusterSettings, ClusterTracker
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.lab.sensing.physics import Physics
from qpavoid.lab.sensing.plant import Drive
from qpavoid.lab.simulation.scenario import Scenario
from qpavoid.model.capsules import PIVOT_X, V_X, V_Y, X1, X2, Y1
from qpavoid.model.estimate import EstimatorSettings, VelocityEstimator
from qpavoid.model.kinematics import to_world
from qpavoid.model.obstacles import Obstacles
from qpavoid.types import Pose

Sensor: TypeAlias = Callable[[float, Obstacles, Pose], Obstacles]
"""From time, obstacles (world frame) and the true pose to obstacles, robot frame."""

Locate: TypeAlias = Callable[[Pose, float, tuple[float, float], float], Pose]
"""From the true pose, time, the wheels' twist and dt to the pose believed."""


def make_sensor(scenario: Scenario) -> Sensor:
    """Return what sees the obstacles: a LiDAR, an estimator, or the truth."""
    if scenario.sensor is not None:
        return scenario.sensor.start()
    if scenario.lidar is not None:
        return _scanner(scenario.lidar, scenario.clusters)
    if scenario.estimation is not None:
        return _estimator(scenario.estimation)
    if scenario.sight == math.inf:
        return lambda time, obstacles, pose: obstacles.seen_from(pose)
    sight = scenario.sight
    return lambda time, obstacles, pose: obstacles.seen_from(pose).within(sight)


def make_localisation(scenario: Scenario) -> Locate:
    """Return the localisation of a run."""
    if scenario.localisation is None:
        return lambda pose, time, wheels, dt: pose
    return scenario.localisation.start(scenario.start)


def make_plant(scenario: Scenario) -> Callable[[float, float, float], Drive]:
    """Return the plant: commanded twist to that of the wheels and over ground."""
    if scenario.plant is None:
        return lambda v, omega, dt: Drive((v, omega), (v, omega))
    if isinstance(scenario.plant, Physics):
        return scenario.plant.start(scenario.start)
    return scenario.plant.start()


def _scanner(settings: LidarSettings, clusters: ClusterSettings) -> Sensor:
    """Return a LiDAR: its points, or discs with velocities that move among them."""
    lidar, tracker = Lidar(settings), ClusterTracker(clusters)

    def see(time: float, obstacles: Obstacles, pose: Pose) -> Obstacles:
        points = lidar.scan(pose, time, obstacles)
        if not settings.tracks:
            return Obstacles(points)
        found = tracker.update(lidar.taken, to_world(points, pose))
        discs = found.discs.copy()
        discs[:, :2] += (time - lidar.taken) * found.disc_velocities
        known = Obstacles(found.points, discs, found.disc_velocities)
        return known.seen_from(pose)

    return see


def _estimator(settings: EstimatorSettings) -> Sensor:
    """Return a Kalman filter of the velocities of discs; all else is known exactly."""
    estimator = VelocityEstimator(settings)

    def see(time: float, obstacles: Obstacles, pose: Pose) -> Obstacles:
        discs, capsules = obstacles.is_disc, obstacles.capsules.copy()
        places = capsules[discs, X1 : Y1 + 1]
        motion = estimator.update(time, range(len(places)), places)
        for begin in (X1, X2, PIVOT_X):
            capsules[discs, begin : begin + 2] = motion.positions
        capsules[discs, V_X : V_Y + 1] = motion.velocities
        return Obstacles.of(obstacles.points, capsules).seen_from(pose)

    return see
