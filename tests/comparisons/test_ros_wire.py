"""The study of the node on the wire, without a wire: its rows and its errors."""

import json
import stat

import pytest

import ros_wire
from qpavoid.errors import QPAvoidError

TOLD = {
    "ready": 3.0,
    "latency": {"n": 9, "p50": 0.0012, "p99": 0.02, "false_stops": 0.01},
    "kill": {"stops": 0.196, "hold": 1.0, "resumes": 0.34, "said": ["scan: stale."]},
    "memory": {"before": 195.0, "after": 195.5, "scans": 180_000},
}


def program(path, text):
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def test_rows_have_units_and_what_is_to_be_reached(tmp_path):
    python = program(tmp_path / "python", f"echo '{json.dumps(TOLD)}'")
    rows = {(r["scene"], r["what"]): r for r in ros_wire.rows_of(played(python))}
    assert len(rows) == 8
    late = rows["latency", "p99"]
    assert (late["value"], late["unit"], late["reach"]) == (20.0, "ms", 10.0)
    stops = rows["kill", "stops"]
    assert (stops["value"], stops["reach"], stops["nav2"]) == (196.0, 200.0, 600.0)
    assert rows["kill", "hold"]["value"] == 100.0
    assert rows["memory", "after"]["value"] == 195.5


def played(python):
    return ros_wire.played(python, ["latency"])


def test_a_peer_that_fails_is_said(tmp_path):
    with pytest.raises(QPAvoidError, match="ended with 3"):
        played(program(tmp_path / "python", "exit 3"))


def test_an_environment_that_cannot_be_made_is_said(tmp_path, monkeypatch):
    failing = program(tmp_path / "python", "echo 'no wheels here' >&2; exit 1")
    monkeypatch.setattr(ros_wire.sys, "executable", str(failing))
    with pytest.raises(QPAvoidError, match="no environment with rclpy: no wheels here"):
        ros_wire.environment(None)


def test_every_scene_that_is_named_exists():
    text = (ros_wire.SUPPORT / "ros_peer.py").read_text()
    scenes = {*ros_wire.OUTAGES, *(scene for scene, _ in ros_wire.REACH)}
    assert all(f"def {scene}(peer, node" in text for scene in scenes)
