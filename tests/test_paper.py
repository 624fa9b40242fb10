"""`comparisons/paper.py`: files, and which of the paper's statements hold."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_figures_tables_and_statements(tmp_path):
    done = subprocess.run(
        [sys.executable, str(ROOT / "comparisons" / "paper.py"), "--out", "out"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    out = tmp_path / "out"
    names = {path.name for path in out.glob("*.png")}
    kinds = ("frames", "poses", "twists", "distance")
    assert names == {f"paper-test_case_{c}-{k}.png" for c in (1, 2) for k in kinds}
    rows = (out / "tables.md").read_text().split("| reproduced |\n")[1].splitlines()[1:]
    assert len(rows) == 13
    refuted = [row.split("|")[2].strip() for row in rows if "**no**" in row]
    assert refuted == [
        "Once the obstacle has passed, the robot returns to its original position.",
        "Method 1 stays closer to the planned position.",
    ]


def test_a_wrong_controller_is_a_usage_error(tmp_path):
    done = subprocess.run(
        [sys.executable, str(ROOT / "comparisons" / "paper.py"), "--methods", "x"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert "unknown controller 'x'" in done.stderr
