"""The entries as WebAssembly: what JavaScript is told is what Python says."""

import json
import math
import shutil
import subprocess

import pytest

from qpavoid.compiled import ENTRIES
from qpavoid.export.build import zig
from qpavoid.export.wasm import WASM_FILES, export_wasm

NODE = shutil.which("node")

pytestmark = [
    pytest.mark.skipif(not (NODE and zig()), reason="no node, or no zig"),
    pytest.mark.long,
]

ASK = """
import { readFileSync } from "node:fs";
import { load } from "./qpavoid.js";
const q = await load(readFileSync(new URL("./qpavoid.wasm", import.meta.url)));
const told = [];
for (const { name, given } of JSON.parse(readFileSync(0))) {
  try { told.push(q[name](...given)); } catch (error) { told.push(String(error)); }
}
console.log(JSON.stringify(told));
"""


def test_the_module_answers_and_refuses_what_does_not_fit(tmp_path):
    """The page of ``play`` drives with it, to the last bit."""
    files = export_wasm(tmp_path, ENTRIES)
    assert [file.name for file in files] == [*WASM_FILES]
    (tmp_path / "ask.mjs").write_text(ASK)
    asked = (
        ("wrap_angle", [7.0]),
        ("wrap_angle", []),
        ("row_at", [[1.0, 2.0], 0.0]),
        ("kanayama", [[0.0, 0.0, "x"], [0.0, 0.0], [0.0, 0.0, 0.0]]),
    )
    text = json.dumps([{"name": name, "given": given} for name, given in asked])
    command = [NODE, tmp_path / "ask.mjs"]
    done = subprocess.run(command, input=text, stdout=-1, text=True, check=True)
    angle, few, none, tuple_ = json.loads(done.stdout)
    assert angle == pytest.approx(7.0 - math.tau)
    assert few == "TypeError: wrap_angle takes 1 arguments, not 0"
    assert none == "TypeError: plan must be a block of this kernel"
    assert tuple_ == "TypeError: error_2 must be a number"
