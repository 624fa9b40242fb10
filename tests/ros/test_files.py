"""The launch file and the Dockerfile: syntax, and that what they name is there."""

import ast
import re
import shlex
import sys
from pathlib import Path
from types import SimpleNamespace

import yaml

from places import ROOT
from qpavoid.cli import main

FOLDER = ROOT / "configs" / "ros"
KINDS = {"arg", "executable", "node", "include", "group", "let"}


def launched():
    document = yaml.safe_load((FOLDER / "safety.launch.yaml").read_text())
    assert set(document) == {"launch"}
    return document["launch"]


def filled(text, given):
    """A text of launch with its variables put in; a name that is none is an error."""
    return re.sub(r"\$\(var (\w+)\)", lambda m: given[m[1]], text)


def test_the_launch_file_starts_the_command(monkeypatch):
    """With its defaults, and with every shipped file of parameters."""
    entries = launched()
    assert all(len(one) == 1 and set(one) <= KINDS for one in entries)
    arguments = {one["arg"]["name"]: one["arg"] for one in entries if "arg" in one}
    given = {name: one["default"] for name, one in arguments.items()}
    (run,) = [one["executable"] for one in entries if "executable" in one]
    assert set(re.findall(r"\$\(var (\w+)\)", run["cmd"])) == set(arguments)
    told = []
    node = SimpleNamespace(main=lambda given: told.append(given) or 0)
    monkeypatch.setitem(sys.modules, "qpavoid.ros.node", node)
    for file in FOLDER.glob("*.yaml"):
        if "launch" in file.name:
            continue
        words = shlex.split(filled(run["cmd"], given | {"params": file.stem}))
        assert words[0] == "qpavoid" and main(words[1:]) == 0
        ros = told.pop()
        assert ros[:2] == ["--ros-args", "--params-file"]
        assert Path(ros[2]).read_bytes() == file.read_bytes()
        assert "cmd_vel_in:=cmd_vel_smoothed" in ros and "cmd_vel_out:=cmd_vel" in ros
    words = shlex.split(filled(run["cmd"], given))
    assert words[words.index("--params") + 1] in {f.stem for f in FOLDER.glob("*.yaml")}


def steps():
    """Instructions of the Dockerfile, with what they are given."""
    text = (FOLDER / "Dockerfile").read_text()
    text = re.sub(r"^#.*\n", "", text, flags=re.MULTILINE).replace("\\\n", "")
    return [tuple(line.split(maxsplit=1)) for line in text.splitlines() if line.strip()]


def test_what_the_dockerfile_compiles_in_advance_is_there():
    (run,) = [rest for name, rest in steps() if name == "RUN" and "import" in rest]
    words = shlex.split(run)
    tree = ast.parse(words[words.index("-c") + 1])
    known = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    assert len(known) >= 3
    names = {}
    exec(compile(ast.Module(known, []), "Dockerfile", "exec"), names)
    used = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)}
    assert used <= {*names, "robot"}
