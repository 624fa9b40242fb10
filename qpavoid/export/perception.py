"""Export of perception for one robot with one LiDAR: C99 source, header and example."""

import math
from collections.abc import Mapping
from typing import Any

from qpavoid.export.translate import Translation
from qpavoid.export.values import Value, braced, c_number, constant, wrapped
from qpavoid.model.capsules import CAPSULE_WIDTH
from qpavoid.model.contact import point_contact
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
from qpavoid.perception.scan import BEAM_COS, BEAM_SIN, BEAM_WIDTH, RAY_SIZE
from qpavoid.perception.settings import Lidar, PerceptionSettings
from qpavoid.perception.tracks import MOST_TRACKS
from qpavoid.perception.update import Found, Memory, Model, Scan, obstacles_at, perceive

PERCEPTION_FILES = ("qpavoid_perception.h", "qpavoid_perception.c", "perceive.c")


def perception_texts(
    robot: Robot, lidar: Lidar, beams: int, settings: PerceptionSettings | None = None
) -> dict[str, Any]:
    """Return the texts of the templates of :data:`PERCEPTION_FILES`, by name.

    Args:
        robot: Robot with the scanner.
        lidar: Geometry of the scanner.
        beams: Number of its beams.
        settings: Of bodies and memory.

    Raises:
        TranslationError: A compiled function cannot be written as C.
    """
    known, device = Perception(robot, lidar, settings), Device(lidar, beams)
    kept = {name: table.shape for name, table in known.memory._asdict().items()}
    kept |= {"rows": (beams * RAY_SIZE,), "counts": (2,)}
    bodies, points = (MOST_TRACKS, CAPSULE_WIDTH), (beams + SIDE * SIDE, 2)
    made = {"points": points, "capsules": bodies}
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
    edges = Value("matrix", "read_only(filter->edges[0], filter->n_edges, 6)")
    model = packed([Value("double", "inner"), *map(constant, known.model[1:])], Model)
    calls = {
        "nearest_edge": call(point_contact, [edges, constant(0.0), constant(0.0)]),
        "started": call(arc, [*pose, *twist, *given("middle - stamp")]),
        "ended": call(arc, [*begin, *twist, *given("QPAVOID_SWEEP")]),
        "taken": call(perceive, [memory, scan, model]),
        "counted": call(
            obstacles_at, [memory, scan, edges, packed(pose), *given("time"), found]
        ),
    }
    return {
        **{name: wrapped(one.text, 1).lstrip() for name, one in calls.items()},
        **{f"{name}_type": one.kind for name, one in calls.items()},
        **geometry(lidar, device),
        "memory_fields": declared(kept),
        "found_fields": declared(made),
        "perception_functions": unit.text,
    }


def geometry(lidar: Lidar, device: Device) -> dict[str, Any]:
    """Return the geometry of a scanner, and limits of poses, as constants of C."""
    first = math.atan2(*device.beams[0, [BEAM_SIN, BEAM_COS]]) + lidar.mount[2]
    known = {
        "beam_first": first,
        "beam_step": device.sensor.step,
        "mount_x": lidar.mount[0],
        "mount_y": lidar.mount[1],
        "range_min": lidar.range_min,
        "range_max": lidar.range_max,
        "sweep": abs(lidar.sweep),
        "delay": lidar.delay,
        "nearest": NEAREST,
        "jump": POSE_JUMP,
        "fastest": FASTEST_POSE,
    }
    table = ",\n".join(wrapped(braced(row), 1) for row in device.beams)
    numbers = {name: c_number(number) for name, number in known.items()}
    return {**numbers, "beam_width": BEAM_WIDTH, "ray": RAY_SIZE, "table": table}


def stored(name: str, shape: tuple[int, ...]) -> Value:
    """Return an array of the memory in C as a value of the translation."""
    kind = ("vector", "matrix")[len(shape) - 1]
    first = f"p->{name}" if len(shape) == 1 else f"&p->{name}[0][0]"
    return Value(kind, f"({kind}){{{', '.join([first, *map(str, shape)])}}}")


def declared(arrays: Mapping[str, tuple[int, ...]]) -> str:
    """Return the members of a C struct of such arrays."""
    sizes = {name: "".join(f"[{n}]" for n in shape) for name, shape in arrays.items()}
    return "\n".join(f"    double {name}{size};" for name, size in sizes.items())
