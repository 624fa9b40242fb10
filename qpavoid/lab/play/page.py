"""The page: scenes, robots and settings as data, and all of it in one HTML file."""

import base64
import gzip
import json
import re
from collections.abc import Iterator, Sequence
from html import escape
from importlib.resources import files
from itertools import zip_longest
from string import Template
from typing import Any, get_args, get_type_hints

import numpy as np

from qpavoid.avoidance.decision import SENTENCES, STATUSES
from qpavoid.avoidance.plan import fresh_state
from qpavoid.avoidance.settings import PARTS, AvoidanceSettings
from qpavoid.avoidance.step import PROBLEM_SIZE
from qpavoid.errors import ConfigError, UnknownNameError
from qpavoid.guide.local_grid import CELL, OUTLINE_SPACING, outline
from qpavoid.guide.rollout import ROWS, TICK
from qpavoid.guide.settings import GuideSettings
from qpavoid.guide.stage import NO_PATH, PER_CONTACT, fresh_stage
from qpavoid.lab.play.program import Program
from qpavoid.lab.scenario.config import find_config, read_document
from qpavoid.lab.scenario.keys import UNITS, attributes_of
from qpavoid.lab.scenario.methods import OURS, REGISTRY
from qpavoid.lab.scenario.scenario import Scenario, make_scenario
from qpavoid.lab.scenario.schema import Preset
from qpavoid.lab.sensing.lidar import LidarSettings
from qpavoid.lab.study.tables import plain
from qpavoid.model.capsules import TURN, V_X, X1, Y1
from qpavoid.model.contacts import CONTACT_SIZE
from qpavoid.model.robot import Limits, Robot
from qpavoid.perception import settings as perceived
from qpavoid.perception.local_map import CELL as MAP_CELL
from qpavoid.perception.local_map import CELL_STATE, HALF
from qpavoid.perception.scan import NO_ECHO_FREE, RAY_SIZE
from qpavoid.perception.tracks import MOST_TRACKS
from qpavoid.perception.update import MAP_STATE, Memory
from qpavoid.settings import Setting, declared, factors
from qpavoid.types import Array

GALLERY = ("demo/play", "demo/crowd", "paper/test_case_1", "paper/test_case_2")
"""Scenes of every page, after the one that is asked for."""

GUIDED = "qp-ahead+guide"

METHODS = {name: REGISTRY[name].description for name in OURS} | {
    GUIDED: "qp-ahead, guided by the coming seconds and round what stalls it"
}
"""Methods of the page, in its order."""

SECTIONS: dict[str, type[Any]] = {
    "radius": PARTS["radius"],
    "filter": AvoidanceSettings,
    **{name: kind for name, kind in PARTS.items() if name != "radius"},
    "guide": GuideSettings,
    "lidar": LidarSettings,
    "perception": perceived.PerceptionSettings,
}
"""Tables of a scenario file that can be set while a robot drives."""

RECORD_NAMES = {
    "weights": ("weight_v", "weight_omega"),
    "acceleration": ("obstacle_acceleration",),
    "mount": ("mount_x", "mount_y", "mount_heading"),
}
"""Names in the compiled record, where they are not those of the fields."""

NOT_PLAYED = ("sight_m", "localisation", "plant", "robots")
"""Tables of a scenario: robots know their pose, and drive as they decide."""

NOT_MEASURED = {"fade": "fade", "sweep": "sweep_s", "delay": "delay_s"}
"""Settings of a LiDAR, and their keys: here scans are taken at once."""

NOT_COMPILED = "v_dead", "omega_dead", "yielding"
"""Settings that are no numbers of the compiled functions."""


def place(layout: np.dtype[Any], field: str) -> int:
    """Return the place of a field among the 32-bit numbers of a record."""
    offsets = {name: at[1] for name, at in (layout.fields or {}).items()}
    return offsets[field] // 4


SIZES = {
    "state": len(fresh_state()),
    "stage": fresh_stage().tolist(),
    "body": PER_CONTACT,
    "contact": CONTACT_SIZE,
    "ahead": ROWS,
    "tick": TICK,
    "cell": CELL,
    "spacing": OUTLINE_SPACING,
    "blocked": NO_PATH,
    "problem": PROBLEM_SIZE,
    "memory": {
        name: array.__metadata__[-1].rows
        for name, array in get_type_hints(Memory, include_extras=True).items()
    },
    "scan": RAY_SIZE,
    "tracks": MOST_TRACKS,
    "all_round": perceived.ALL_ROUND,
    "no_echo_free": NO_ECHO_FREE,
    "angle_error": perceived.Lidar().angle_error,
    "map": {
        "cell": MAP_CELL,
        "half": HALF,
        "width": CELL_STATE.itemsize // 4,
        "free": place(CELL_STATE, "ever_free"),
        "middle": place(MAP_STATE, "middle_i"),
    },
}
"""Array sizes of the compiled functions."""

DRAWING = ("dom.js", "pen.js", "panels.js", "charts.js")
OWN = (
    *("world.js", "lidar.js", "pilot.js", "toml.js", "form.js", "hands.js"),
    *("robots.js", "ranges.js", "words.js", "play.js"),
)


def play_page(
    program: Program, config: str, methods: Sequence[str], data: str | None = None
) -> str:
    """Return the page as one HTML file that opens from disk and asks for nothing.

    Args:
        program: The package as WebAssembly.
        config: Path of a scenario file, or its shipped name: the first scene.
        methods: That drive at first.
        data: Folder of published data sets, where the scenario needs one.

    Raises:
        UnknownNameError: No scenario of that name, or a method that is not there.
        ConfigError: The scenario file is not valid, or has several robots.
    """
    for name in methods:
        if name not in METHODS:
            raise UnknownNameError("controller of the page", name, METHODS)
    scenes = [scene(config, data)]
    scenes += [scene(name) for name in GALLERY if name != scenes[0]["name"]]
    given = {
        "program": base64.b64encode(gzip.compress(program.module, 9, mtime=0)).decode(),
        "scenes": scenes,
        "methods": METHODS,
        "chosen": list(methods),
        "robots": {
            name: robot_data(getattr(Robot, name)()) for name in get_args(Preset)
        },
        "limits": list(entries("robot", Limits)),
        "settings": [
            one for name, kind in SECTIONS.items() for one in entries(name, kind)
        ],
        "ordered": list(ordered()),
        "sizes": SIZES,
        "statuses": list(STATUSES),
        "sentences": {str(status): text for status, text in SENTENCES.items()},
    }
    # A module of JavaScript as a script that a page may hold.
    text = re.sub(r"^export ", "", program.script, flags=re.MULTILINE)
    kernel = f"const Qpavoid = (() => {{\n{text}\nreturn {{ Kernel }};\n}})();"
    return Template(part("page.html")).substitute(
        title=escape(scenes[0]["title"]),
        style=part("style.css") + part("play.css"),
        data=as_json(given),
        scripts="\n".join(
            f"<script>{text}</script>"
            for text in [*map(part, DRAWING), kernel, *map(part, OWN)]
        ),
    )


def part(name: str) -> str:
    """Return the text of a file beside this one."""
    return (files(__package__) / name).read_text(encoding="utf-8")


def as_json(data: Any) -> str:
    """Return JSON that no HTML can hide in, NaN and infinities as ``null``."""
    text = json.dumps(plain(data), ensure_ascii=True, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def packed(array: Array) -> str:
    """Return numbers as base64 of little-endian doubles, to the last bit."""
    return base64.b64encode(np.asarray(array, "<f8").tobytes()).decode()


def robot_data(robot: Robot) -> dict[str, Any]:
    """Return a robot as the page takes it."""
    return {
        "name": robot.name,
        "outlines": [x.tolist() for x in robot.footprint.outlines],
        "edges": packed(robot.footprint.edges),
        "limits": packed(robot.limit_vector),
        "outline": packed(outline(robot.footprint)),
        "inner": robot.footprint.inner_radius,
    }


def scene(config: str, data: str | None = None) -> dict[str, Any]:
    """Return a scenario as the page takes it, with what of it is not played."""
    name, file = find_config(config)
    document, _ = read_document(file)
    if document.get("robots"):
        raise ConfigError([f"{file}: robots: play has one robot"])
    kept = {key: value for key, value in document.items() if key not in NOT_PLAYED}
    made = make_scenario(kept, name, file, data)
    parked = {**kept, "tracking": {**kept.get("tracking", {}), "station_keeping": True}}
    station = make_scenario(parked, name, file, data).tracker
    left_out = ("frames_s", "ends_at_goal", "obstacles")
    return {
        "name": name,
        "title": made.title,
        "document": {k: v for k, v in kept.items() if k not in left_out},
        "left_out": [
            *(key for key in NOT_PLAYED if key in document),
            *({*document.get("lidar", {})} & {*NOT_MEASURED.values()}),
            *({*document.get("guide", {})} & {"yielding"}),
        ],
        "dt": made.dt,
        "duration": made.duration,
        "start": made.start,
        "plan": packed(made.path.sample(made.times)),
        "law": packed(made.tracker.array),
        "station": packed(station.array),
        "lags": made.waiting.lags,
        "robot": robot_data(made.robot),
        "guided": made.guide is not None,
        "lidar": made.lidar is not None,
        "settings": values_of(made),
        "obstacles": obstacles_of(made),
    }


def obstacles_of(made: Scenario) -> dict[str, Any]:
    """Return the obstacles of a scenario by kind."""
    world = made.world
    tracks = [
        {
            "times": track.times.tolist(),
            "positions": track.positions.tolist(),
            "radius": track.radius,
            "endless": track.endless,
            "fleeting": track.fleeting,
        }
        for track in world.tracks
    ]
    carts = [
        {
            "corners": chain[:, X1 : Y1 + 1].tolist(),
            "velocity": chain[0, V_X:TURN].tolist(),
            "turn": float(chain[0, TURN]),
        }
        for chain in world.polygons.chains
    ]
    return {
        "points": world.points.tolist(),
        "discs": world.discs.tolist(),
        "tracks": tracks,
        "walls": world.walls.tolist(),
        "carts": carts,
    }


def entries(section: str, kind: type[Any]) -> Iterator[dict[str, Any]]:
    """Yield what can be set in a table: key, unit, range, default, effect."""
    said = attributes_of(kind)
    for setting in declared(kind):
        if setting.name in NOT_MEASURED and section == "lidar":
            continue
        if setting.name in NOT_COMPILED:
            continue
        names = RECORD_NAMES.get(setting.name, (setting.name,))
        if section != "margins" and setting.name == "acceleration":
            names = (setting.name,)
        defaults = (None,) if setting.default is ... else setting.of(setting.default)
        for key, name, default in zip_longest(setting.keys, names, defaults):
            if key is not None:
                units = (UNITS[end] for end in UNITS if key.endswith(f"_{end}"))
                yield {
                    "section": section,
                    "key": key,
                    "name": name,
                    "default": default,
                    "unit": next(units, ""),
                    "choices": setting.choices,
                    "switch": setting.kind is bool,
                    "range": bounds(setting),
                    "effect": said.get(setting.name, ""),
                }


def ordered() -> Iterator[tuple[list[str | float], str, list[str | float]]]:
    """Yield the order of settings: factors (``section.key``, ``dt``), sign, factors."""
    keys = {
        f"{section}.{one.name}": f"{section}.{one.keys[0]}"
        for section, kind in SECTIONS.items()
        for one in declared(kind)
        if one.keys
    }
    for section, kind in SECTIONS.items():
        for first, sign, second in getattr(kind, "ORDERED", ()):
            one, other = (
                [keys.get(f"{section}.{x}", keys.get(str(x), x)) for x in factors(side)]
                for side in (first, second)
            )
            yield one, sign, other


def bounds(setting: Setting) -> dict[str, Any]:
    """Return the range of a setting; ``finite`` where it may not be infinite."""
    if setting.range is None:
        return {}
    gt, ge, lt, le, inf = setting.range
    named = {"gt": gt, "ge": ge, "lt": lt, "le": le}
    found: dict[str, Any] = {k: v for k, v in named.items() if v is not None}
    return found | {"finite": inf is False}


def values_of(made: Scenario) -> dict[str, Any]:
    """Return the value of every entry by ``section.key``; null stands for infinite."""
    parts = {
        "guide": made.guide or GuideSettings(),
        "lidar": made.lidar or LidarSettings(),
        "perception": made.perception,
    }
    found: dict[str, Any] = {}
    for section, kind in SECTIONS.items():
        own = parts.get(section, getattr(made.settings, section, made.settings))
        for setting in declared(kind):
            if hasattr(own, setting.name) and setting.name not in NOT_COMPILED:
                values = setting.of(getattr(own, setting.name))
                pairs = zip(setting.keys, values, strict=False)
                found |= {f"{section}.{key}": value for key, value in pairs}
    return found
