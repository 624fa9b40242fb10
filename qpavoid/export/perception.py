"""Export of perception for one robot with one LiDAR: C99 source, header and example."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from qpavoid.export.translate import Translation
from qpavoid.export.values import Value, braced, c_number, constant, wrapped
from qpavoid.model.capsules import CAPSULE_WIDTH
from qpavoid.model.kinematics import arc
from qpavoid.model.robot import Robot
from qpavoid.perception.local_map import SIDE
from qpavoid.perception.perception import (
    FASTEST_POSE,
    NEAREST,
    POSE_JUMP,
    Device,
    Perception,
)
from qpavoid.perception.scan import BEAM_WIDTH, SCAN_WIDTH
from qpavoid.perception.settings import Lidar, PerceptionSettings
from qpavoid.perception.tracks import MOST_TRACKS
from qpavoid.perception.update import Found, Memory, Scan, obstacles_at, perceive

PERCEPTION_FILES = ("qpavoid_perception.h", "qpavoid_perception.c", "perceive.c")


def perception_texts(
    robot: Robot, lidar: Lidar, beams: int, settings: PerceptionSettings | None = None
) -> dict[str, Any]:
    """Return the texts of the templates of :data:`PERCEPTION_FILES`, by name.

    Args:
        robot: Its footprint is left out of the obstacles.
        lidar: Geometry of the scanner.
        beams: Number of its beams.
        settings: Of bodies and memory.

    Raises:
        TranslationError: A compiled function cannot be written as C.
    """
    known, device = Perception(robot, lidar, settings), Device(lidar, beams)
    kept = {name: table.shape for name, table in known.memory._asdict().items()}
    kept |= {"rows": (beams, SCAN_WIDTH), "counts": (2,)}
    made = {
        "points": (beams + SIDE * SIDE, 2),
        "capsules": (MOST_TRACKS, CAPSULE_WIDTH),
    }
    arrays = {name: stored(name, shape) for name, shape in (kept | made).items()}
    unit = Translation()
    call, packed = unit.call, unit.structs.packed

    def numbers(values: Any) -> Value:
        parts = [numbers(x) if isinstance(x, tuple) else constant(x) for x in values]
        return packed(parts, type(values))

    def given(*names: str) -> list[Value]:
        return [Value("double", name) for name in names]

    table = Value("matrix", f"read_only(&beams[0][0], {beams}, {BEAM_WIDTH})")
    begin, motion, pose = (
        given(*(f"{name}[{i}]" for i in range(3)))
        for name in ("p->begin", "p->motion", "pose")
    )
    twist = given("twist[0]", "twist[1]")
    parts = [arrays["rows"], table, numbers(device.sensor), arrays["counts"]]
    scan = packed([*parts, *given("p->time"), packed(begin), packed(motion)], Scan)
    memory = packed([arrays[name] for name in Memory._fields], Memory)
    found = packed([arrays[name] for name in Found._fields], Found)
    edges = Value("", "edges", known=robot.footprint.edges)
    started = call(arc, [*pose, *twist, *given("middle - stamp")])
    ended = call(arc, [*begin, *twist, *given("QPAVOID_SWEEP")])
    taken = call(perceive, [memory, scan, numbers(known.model)])
    asked = [memory, scan, edges, packed(pose), *given("time"), found]
    counted = call(obstacles_at, asked)
    angles = np.arctan2(device.beams[:, 1], device.beams[:, 0]) + lidar.mount[2]
    return {
        "beams": beams,
        "beam_first": c_number(float(angles[0])),
        "beam_step": c_number(device.sensor.step),
        "mount_x": c_number(lidar.mount[0]),
        "mount_y": c_number(lidar.mount[1]),
        "range_min": c_number(lidar.range_min),
        "range_max": c_number(lidar.range_max),
        "sweep": c_number(abs(lidar.sweep)),
        "delay": c_number(lidar.delay),
        "nearest": c_number(NEAREST),
        "jump": c_number(POSE_JUMP),
        "fastest": c_number(FASTEST_POSE),
        "beam_width": BEAM_WIDTH,
        "table": ",\n".join(wrapped(braced(row), 1) for row in device.beams),
        "memory_fields": declared(kept),
        "found_fields": declared(made),
        "pose_type": started.kind,
        "started": wrapped(started.text, 1).lstrip(),
        "ended": wrapped(ended.text, 1).lstrip(),
        "taken": wrapped(taken.text, 1).lstrip(),
        "counted_type": counted.kind,
        "counted": wrapped(counted.text, 1).lstrip(),
        "perception_functions": unit.text,
    }


def stored(name: str, shape: tuple[int, ...]) -> Value:
    """Return an array of the memory in C as a value of the translation."""
    kind = ("vector", "matrix")[len(shape) - 1]
    first = f"p->{name}" if len(shape) == 1 else f"&p->{name}[0][0]"
    return Value(kind, f"({kind}){{{', '.join([first, *map(str, shape)])}}}")


def declared(arrays: Mapping[str, tuple[int, ...]]) -> str:
    """Return the members of a C struct of such arrays."""
    sizes = {name: "".join(f"[{n}]" for n in shape) for name, shape in arrays.items()}
    return "\n".join(f"    double {name}{size};" for name, size in sizes.items())
