"""Model predictive path integral control [Williams2017], compiled roll-outs."""

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from qpavoid.avoidance.controllers import Step, StepContext
from qpavoid.compiled import compiled_once, entry
from qpavoid.lab.baselines.drive import (
    Baseline,
    Command,
    out_of_reach,
    reference_ahead,
    soonest_reached,
    wide_discs,
    wide_lines,
    wide_still,
)
from qpavoid.lab.baselines.predictive import command_of, everything_wide
from qpavoid.model.capsules import RADIUS, Segment, capsule_at, from_segment
from qpavoid.model.contact import point_contact, wall_contact
from qpavoid.model.kinematics import arc
from qpavoid.model.obstacles import Obstacles
from qpavoid.model.robot import limit_twist, limits_of
from qpavoid.types import (
    Array,
    Capsules,
    Discs,
    Edges,
    LimitVector,
    Matrix,
    MatrixWritten,
    Pose,
    Sizes,
    Twist,
    Vector,
    VectorWritten,
)

TICK = 0.1
"""s; of a roll-out, and period of planning."""

HELD_FOR = 5
"""Ticks for which noise is held: white noise would hardly turn a robot."""

CONTACT = 1e3
"""Cost per tick from the first contact on."""


@dataclass(frozen=True)
class MppiController(Baseline):
    """MPPI over twists: noisy copies of the last plan, averaged by their cost.

    A sample costs, per tick, the squared distance from the reference, its heading
    error, its depth within r_min of any obstacle (polygon footprint; obstacles move and
    turn on), and contact. The new plan is the mean of all samples weighted by
    exp(−cost/λ); the base distribution is the last plan's, so that noise itself costs
    nothing. Two samples are the desired twist held, and standing still. A plan within
    r_min is ``relaxed``. If no obstacle can be reached within the horizon, the desired
    twist is driven.

    Attributes:
        samples: Number of samples.
        ticks: Of the horizon, 0.1 s each.
        temperature: λ.
        noise_v: Standard deviation, m/s.
        noise_omega: Standard deviation, rad/s.
        heading: Cost of 1 − cos of the heading error, m².
        nearness: Cost per tick of a depth of 1 m within r_min.
        seed: Of the noise; each run starts with it.
    """

    samples: int = 512
    ticks: int = 40
    temperature: float = 0.3
    noise_v: float = 0.3
    noise_omega: float = 0.6
    heading: float = 0.3
    nearness: float = 30.0
    seed: int = 0

    def start(self, v: float = 0.0, omega: float = 0.0) -> Step:
        """Return the step of a new run, of a robot that drives (v, ω) at present."""
        rng = np.random.default_rng(self.seed)
        twists = np.tile((v, omega), (self.ticks, 1))
        horizon = TICK * self.ticks

        def plan(
            desired: Twist, obstacles: Obstacles, context: StepContext
        ) -> Command | None:
            near = everything_wide(obstacles, self.settings)
            if out_of_reach(self.robot, near, horizon):
                twists[:] = desired
                return None
            samples = self.draw(rng, twists, desired)
            by = self.judgement(obstacles, context)
            mean = np.zeros((1, samples.shape[1]))
            rollout(by, samples)
            average(self.temperature, samples, mean[0])
            rollout(by, mean)
            # The plan is held for a tick, and is then a tick shorter at its beginning.
            now, *later = mean[0, :-2].reshape(-1, 2)
            twists[:-1], twists[-1] = later, mean[0, -4:-2]
            v, omega = now.tolist()
            return command_of((v, omega), float(mean[0, -1]))

        return self.stepping((v, omega), plan, TICK)

    def judgement(self, obstacles: Obstacles, context: StepContext) -> "Judgement":
        """Return the context of the samples' cost in this step."""
        discs = wide_discs(obstacles, self.settings)
        soonest = soonest_reached(self.robot, discs, context.driven[0])
        order = np.argsort(soonest, kind="stable")
        return Judgement(
            self.robot.footprint.edges,
            self.robot.limit_vector,
            discs[order],
            soonest[order],
            wide_lines(obstacles, self.settings),
            wide_still(self.settings),
            reference_ahead(context, self.robot, self.ticks, TICK),
            (self.heading, self.nearness),
            context.driven,
        )

    def draw(self, rng: np.random.Generator, twists: Array, desired: Twist) -> Array:
        """Return samples (n, 2·ticks + 2): the last plan, and noisy copies of it.

        The last two columns are free, for cost and depth.
        """
        blocks = math.ceil(self.ticks / HELD_FOR)
        noise = rng.standard_normal((self.samples, blocks, 2))
        noise *= self.noise_v, self.noise_omega
        noise[0] = 0.0
        samples: Array = twists + np.repeat(noise, HELD_FOR, axis=1)[:, : self.ticks]
        samples[1], samples[2] = desired, 0.0
        return np.pad(samples.reshape(self.samples, -1), ((0, 0), (0, 2)))


class Judgement(NamedTuple):
    """Context of the cost of samples.

    Attributes:
        edges: Of the footprint.
        robot: See :attr:`qpavoid.model.robot.Robot.limit_vector`.
        discs: (m, 5) of :func:`qpavoid.lab.baselines.drive.wide_discs`, in the order of
            ``soonest``.
        soonest: (m,) of :func:`qpavoid.lab.baselines.drive.soonest_reached`, s.
        lines: (k, 11) of :func:`qpavoid.lab.baselines.drive.wide_lines`.
        r_min: Of static obstacles, m.
        reference: (ticks, 3) reference poses after each tick, robot frame.
        weights: Of heading and nearness.
        driven: Twist driven last.
    """

    edges: Edges
    robot: LimitVector
    discs: Discs
    soonest: Vector
    lines: Capsules
    r_min: float
    reference: Annotated[Matrix, Sizes(0, 3)]
    weights: tuple[float, float]
    driven: Twist


@entry
@compiled_once
def rollout(by: Judgement, samples: Annotated[MatrixWritten, Sizes(0, 2)]) -> None:
    """Fill cost and greatest depth within r_min, m, of samples (n, 2·ticks + 2).

    These are the last two columns; the twists are cut to the robot's limits in place.
    """
    reference, weights = by.reference, by.weights
    last = samples.shape[1] - 2
    ticks = min(reference.shape[0], last // 2)
    for i in range(samples.shape[0]):
        x = y = heading = cost = deepest = 0.0
        v, omega = by.driven
        for k in range(ticks):
            wanted = (samples[i, 2 * k], samples[i, 2 * k + 1])
            v, omega = limit_twist(by.robot, wanted, (v, omega), TICK)
            samples[i, 2 * k], samples[i, 2 * k + 1] = v, omega
            x, y, heading = arc(x, y, heading, v, omega, TICK)
            off_x, off_y = x - reference[k, 0], y - reference[k, 1]
            cost += off_x * off_x + off_y * off_y
            cost += weights[0] * (1.0 - math.cos(heading - reference[k, 2]))
            depth = depth_within(by, (x, y, heading), (k + 1) * TICK)
            cost, deepest = cost + weights[1] * depth, max(deepest, depth)
            if depth > by.r_min:
                # As if it stayed in contact: a later contact costs less.
                cost += CONTACT * (ticks - k)
                break
        samples[i, last], samples[i, last + 1] = cost, deepest


@entry
@compiled_once
def average(
    temperature: float,
    samples: Annotated[Matrix, Sizes(0, 2)],
    mean: VectorWritten,
) -> None:
    """Fill the mean of samples (n, 2·ticks + 2) weighted by exp(−cost/λ).

    In the same order on every processor, since rounding can change the robot's path in
    a crowd; sums of a matrix library depend on the processor.
    """
    many, cost = samples.shape[0], samples.shape[1] - 2
    size = min(cost, mean.shape[0])
    # Relative to the least cost, which cancels: else all weights would underflow.
    least, total = math.inf, 0.0
    for i in range(many):
        least = min(least, samples[i, cost])
    for j in range(size):
        mean[j] = 0.0
    for i in range(many):
        weight = math.exp((least - samples[i, cost]) / temperature)
        total += weight
        for j in range(size):
            mean[j] += weight * samples[i, j]
    for j in range(size):
        mean[j] /= total


@compiled_once
def depth_within(by: Judgement, pose: Pose, time: float) -> float:
    """Return the depth of a footprint at a pose within r_min of any obstacle, m, ≥ 0.

    Obstacles have moved for ``time`` s.
    """
    (x, y, heading), edges, lines = pose, by.edges, by.lines
    circumradius = limits_of(by.robot).circumradius
    cos, sin = math.cos(heading), math.sin(heading)
    depth = 0.0
    for i in range(min(by.discs.shape[0], by.soonest.shape[0])):
        if by.soonest[i] > time:
            break
        radius = by.discs[i, 2]
        d_x = by.discs[i, 0] + time * by.discs[i, 3] - x
        d_y = by.discs[i, 1] + time * by.discs[i, 4] - y
        if d_x * d_x + d_y * d_y < (circumradius + radius) ** 2:
            touch = point_contact(edges, cos * d_x + sin * d_y, cos * d_y - sin * d_x)
            depth = max(depth, radius - touch.distance)
    for i in range(lines.shape[0]):
        axis, wanted = capsule_at(lines, i, time), lines[i, RADIUS]
        d_x, d_y = from_segment(axis, x, y)
        if d_x * d_x + d_y * d_y < (circumradius + wanted) ** 2:
            a_x, a_y, b_x, b_y = axis.x1 - x, axis.y1 - y, axis.x2 - x, axis.y2 - y
            wall = Segment(
                cos * a_x + sin * a_y,
                cos * a_y - sin * a_x,
                cos * b_x + sin * b_y,
                cos * b_y - sin * b_x,
            )
            depth = max(depth, wanted - wall_contact(edges, wall).distance)
    return depth
