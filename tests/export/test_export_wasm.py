"""The entries as WebAssembly: what JavaScript is told is what Python says."""

import json
import math
import shutil
import subprocess

import numpy as np
import pytest

from qpavoid import AvoidanceSettings, Robot
from qpavoid.avoidance.plan import fresh_state
from qpavoid.avoidance.step import filter_step, memory_size
from qpavoid.compiled import ENTRIES
from qpavoid.export.build import zig
from qpavoid.export.wasm import WASM_FILES, export_wasm
from qpavoid.model.contacts import most_contacts

NODE = shutil.which("node")

pytestmark = [
    pytest.mark.skipif(not (NODE and zig()), reason="no node, or no zig"),
    pytest.mark.long,
]

ASK = """
import { readFileSync } from "node:fs";
import { load } from "./qpavoid.js";
const q = await load(readFileSync(new URL("./qpavoid.wasm", import.meta.url)));
const asked = JSON.parse(readFileSync(0), (_, x) => (x === "inf" ? Infinity : x));
const block = (x) =>
  x?.vector ? q.vector(x.vector)
  : x?.matrix ? q.matrix(x.matrix, x.columns)
  : x?.record ? q.record(x.record, x.fields)
  : Array.isArray(x) ? x.map(block)
  : x;
const told = [];
for (const { name, given, times } of asked) {
  const blocks = given.map(block);
  for (let i = 0; i < times; i++) {
    try { told.push(q[name](...blocks)); } catch (error) { told.push(String(error)); }
  }
}
console.log(JSON.stringify(told));
"""


@pytest.fixture(scope="module")
def ask(tmp_path_factory):
    """Return a function that asks the module, and closes its JSON over infinities."""
    folder = tmp_path_factory.mktemp("wasm")
    files = export_wasm(folder, ENTRIES)
    assert [file.name for file in files] == [*WASM_FILES]
    assert all(file.stat().st_size > 0 for file in files)
    (folder / "ask.mjs").write_text(ASK)

    def asking(*asked):
        data = [{"name": n, "given": g, "times": t} for n, g, t in asked]
        text = json.dumps(data).replace("Infinity", '"inf"')
        command = [NODE, folder / "ask.mjs"]
        done = subprocess.run(command, input=text, stdout=-1, text=True, check=True)
        return json.loads(done.stdout)

    return asking


def test_the_filter_drives_the_same_in_a_loop(ask):
    robot, settings = Robot.mir100(), AvoidanceSettings()
    record, edges, steps = settings.record(), robot.footprint.edges, 100
    points = np.random.default_rng(2).uniform(-3.0, 3.0, (60, 2))
    points = points[np.hypot(*points.T) > 1.2]
    capsules, state = np.empty((0, 12)), fresh_state()
    size = memory_size(most_contacts(edges, (points, capsules)), record)
    fields = dict(zip(record.dtype.names, record[0].tolist(), strict=True))
    given = [
        {"matrix": edges.tolist(), "columns": edges.shape[1]},
        {"vector": robot.limit_vector.tolist()},
        {"record": "filter_settings", "fields": fields},
        {"matrix": points.tolist(), "columns": 2},
        {"matrix": [], "columns": 12},
        *(0.0, True, 0.7, 0.3),
        {"vector": state.tolist()},
        {"vector": [0.0] * size},
    ]
    told = ask(("filter_step", given, steps))
    memory = np.empty(size)
    asked = (edges, robot.limit_vector, record, points, capsules, 0.0, True, 0.7, 0.3)
    for answer in told:
        right = filter_step(*asked, state, memory)
        assert answer[0] == right[0]
        assert np.allclose(answer, right, rtol=1e-9, atol=1e-12)
    assert math.hypot(*told[-1][1:3]) > 0.0


def test_what_does_not_fit_is_refused_before_the_module_sees_it(ask):
    few, none, tuple_ = ask(
        ("wrap_angle", [], 1),
        ("row_at", [[1.0, 2.0], 0.0], 1),
        ("kanayama", [[0.0, 0.0, "x"], [0.0, 0.0], [0.0, 0.0, 0.0]], 1),
    )
    assert few == "TypeError: wrap_angle takes 1 arguments, not 0"
    assert none == "TypeError: plan must be a block of this kernel"
    assert tuple_ == "TypeError: error_2 must be a number"
