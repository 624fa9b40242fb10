"""Launch files, package and Dockerfile: syntax, and that what they name is there."""

import ast
import configparser
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import yaml

from places import ROOT
from qpavoid.cli import main
from qpavoid.ros.parameters import Wiring, defaults, preset

FOLDER = ROOT / "configs" / "ros"
KINDS = {"arg", "executable", "node", "include", "group", "let"}


def filled(text, given):
    """A text of launch with its variables put in; a name that is none is an error."""
    return re.sub(r"\$\(var (\w+)\)", lambda m: given[m[1]], text)


def test_the_launch_file_starts_the_command(monkeypatch):
    """With its defaults, and with every shipped file of parameters."""
    document = yaml.safe_load((FOLDER / "safety.launch.yaml").read_text())
    entries = document["launch"]
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


PACKAGE = ROOT / "qpavoid" / "ros" / "package"


def test_the_package_starts_the_node_with_parameters_that_it_has():
    """Launch has no wheels on PyPI: its file is parsed."""
    launch = ElementTree.parse(PACKAGE / "launch" / "qpavoid.launch.xml").getroot()
    given = {one.get("name"): one.get("default") for one in launch.iter("arg")}
    (node,) = launch.iter("node")
    used = re.findall(r"\$\(var (\w+)\)", ElementTree.tostring(launch, "unicode"))
    assert set(used) == set(given) and given["role"] == Wiring().role
    known = {*Wiring._fields, *defaults(preset("jackal"))}
    names = {one.get("name") for one in node.iter("param")} - {None, "use_sim_time"}
    assert names == {"role", "drive.mode", "autostart"} and names <= known
    config = configparser.ConfigParser()
    config.read(PACKAGE / "setup.cfg")
    script, _, target = config["options.entry_points"]["console_scripts"].partition("=")
    assert (node.get("pkg"), node.get("exec")) == ("qpavoid_ros", script.strip())
    assert target.strip() == "qpavoid.ros.node:main"


def test_the_package_depends_on_all_that_the_node_imports():
    manifest = ElementTree.parse(PACKAGE / "package.xml").getroot()
    depends = {one.text for one in manifest.iter("exec_depend")}
    trees = [ast.parse(file.read_text()) for file in PACKAGE.parent.glob("*.py")]
    imports = [x for tree in trees for x in ast.walk(tree)]
    roots = {x.module.split(".")[0] for x in imports if isinstance(x, ast.ImportFrom)}
    known = {x for x in roots if x.endswith("_msgs") or x[:3] in ("rcl", "bon")}
    assert "bond" in known and known <= depends
    assert manifest.find("name").text == "qpavoid_ros"


def test_the_package_is_built_as_ament_does(tmp_path):
    """As colcon installs a package of ament_python: by its setup.py."""
    source = tmp_path / "source"
    shutil.copytree(PACKAGE, source)
    run = [sys.executable, "setup.py", "-q", "install", "--prefix", str(tmp_path)]
    more = ["--single-version-externally-managed", "--record", str(tmp_path / "files")]
    environment = os.environ | {"PYTHONWARNINGS": "ignore"}
    subprocess.run([*run, *more], cwd=source, check=True, env=environment)
    assert (tmp_path / "lib" / "qpavoid_ros" / "node").stat().st_mode & 0o100
    share = tmp_path / "share"
    assert (share / "ament_index/resource_index/packages/qpavoid_ros").is_file()
    assert (share / "qpavoid_ros" / "package.xml").is_file()
    assert (share / "qpavoid_ros" / "launch" / "qpavoid.launch.xml").is_file()


def test_the_sample_for_nav2_gives_the_node_a_manager_without_bond():
    told = yaml.safe_load((FOLDER / "nav2" / "nav2_params.yaml").read_text())
    managed = {k: x["ros__parameters"] for k, x in told.items() if "manager" in k}
    own = managed.pop("lifecycle_manager_qpavoid")
    assert own["node_names"] == ["qpavoid"] and own["bond_timeout"] == 0.0
    for other in managed.values():
        assert not {"qpavoid", "controller_server"} & {*other["node_names"]}


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
