"""The extension module: the bits of numba, and a border that nothing wrong crosses.

What compares bits waits for numba to compile, and is run by ``.ci/run`` on its own."""

import os
import subprocess
import sys
import tomllib
from dataclasses import replace
from importlib import import_module
from inspect import signature
from typing import get_type_hints

import numpy as np
import pytest

from hostile_filters import FILTERS, in_python, problems_of
from in_c import COMPILER, loaded
from places import ROOT
from qpavoid import Guide, Obstacles, Robot
from qpavoid.avoidance.bodies import Request, Setup
from qpavoid.avoidance.decision import Decision
from qpavoid.avoidance.plan import fresh_state
from qpavoid.avoidance.settings import AvoidanceSettings
from qpavoid.avoidance.step import NO_ANSWER
from qpavoid.compiled import ENTRIES
from qpavoid.export.build import FLAGS, MACOS, SHARED, compile_c, system_compiler, zig
from qpavoid.export.entries import shape_of
from qpavoid.export.extension import build_extension, extension_text
from qpavoid.guide.settings import GuideSettings
from qpavoid.guide.stage import (
    ACTION,
    COUNT,
    WAY,
    Stage,
    Tracking,
    fresh_stage,
    stage_memory,
)
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.lab.simulation.run import run
from qpavoid.model.contacts import CONTACT_SIZE
from qpavoid.stamps import PACKAGE

HOOK = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
for module in HOOK["targets"]["wheel"]["hooks"]["custom"]["modules"]:
    import_module(module)

pytestmark = pytest.mark.skipif(not (system_compiler() or zig()), reason="no compiler")


@pytest.fixture(scope="module")
def native(tmp_path_factory):
    file = tmp_path_factory.mktemp("extension") / "_native.abi3.so"
    assert build_extension(file)
    return loaded(file)


@pytest.fixture
def both(native, monkeypatch):
    """All entries, each calling both of its codes."""
    made = {name: Both(one, getattr(native, name)) for name, one in ENTRIES.items()}
    for name, one in ENTRIES.items():
        monkeypatch.setitem(vars(one), "call", made[name])
    return made


def compare(both, name, problems):
    robot, settings, ahead, _ = FILTERS[name]
    in_python(robot, settings, ahead, problems)
    assert both["filter_step"].calls >= 0.5 * len(problems)
    return both["filter_step"].results


@pytest.mark.long
@pytest.mark.parametrize("name", ["ahead-late", "limited", "repulsion"])
def test_a_filter_has_the_bits_of_numba(both, name):
    assert {-1, 0, 1, 2} <= compare(both, name, problems_of(name)[:900])


@pytest.mark.long
@pytest.mark.parametrize("method", ["eq5", "eq7", "qp", "qp-ahead+guide"])
def test_a_run_has_the_bits_of_numba(both, method):
    scenario = load_scenario("demo/trap" if "guide" in method else "paper/test_case_1")
    run(replace(scenario, duration=2.5), method)
    assert sum(one.calls > 0 for one in both.values()) >= 9


@pytest.mark.long
def test_a_lidar_has_the_bits_of_numba(both):
    rng, lidar = np.random.default_rng(4), Lidar(LidarSettings(beams=90))
    for _ in range(50):
        seen = Obstacles(
            rng.normal(0.0, 2.0, (3, 2)),
            discs=rng.normal(1.0, 1.0, (4, 3)) ** 2,
            walls=rng.normal(0.0, 3.0, (2, 4)),
            polygons=[np.array([(0, 0), (1, 0), (0, 1)]) + rng.normal(0, 1, 2)],
        )
        lidar.ranges(rng.normal(0.0, 1.0, 3), seen)
    assert both["cast_rays"].calls == 50


@pytest.mark.long
def test_a_guide_that_searches_a_way_has_the_bits_of_numba(both):
    walls = [(1.5, -2.0, 1.5, 2.0), (-1.5, 2.0, 1.5, 2.0)]
    guide, steps = Guide(Robot.mir100()), 0
    guide.go_to((0.0, 0.0, 0.0), (4.0, 0.0, 0.0))
    pose, states = (0.0, 0.0, 0.0), both["guide_step"].results
    while 2 not in states and steps < 2_000:
        decision = guide.step(pose, Obstacles(walls=walls).seen_from(pose))
        given = *pose, decision.v, decision.omega, guide.settings.dt
        pose, steps = both["arc"].native(*given), steps + 1
    assert 2 in states, "no way round was followed"


GOOD = Robot.mir100().limit_vector


def shapes_of(function):
    hints = get_type_hints(function, include_extras=True)
    return [shape_of(hints[name], name) for name in signature(function).parameters]


def given_for(entry, wrong=None, make=None, more=0):
    """Arguments of an entry that are as small as they may be, but for a wrong leaf."""
    seen = iter(range(1_000))

    def made(shape):
        if not shape.kind:
            return tuple(map(made, shape.parts))
        number = next(seen)
        if shape.kind in ("int", "bool", "double"):
            return {"int": 0, "bool": False, "double": 0.5}[shape.kind]
        if shape.least:
            right = np.zeros([least + more for least in shape.least])
        else:
            right = np.zeros(1, shape.record.dtype)
        return make(right) if number == wrong else right

    return [*map(made, shapes_of(entry.py_func))]


def arrays_of(entry):
    leaves = [leaf for shape in shapes_of(entry.py_func) for leaf in shape.leaves]
    arrays = ("int", "bool", "double")
    return [(i, leaf) for i, leaf in enumerate(leaves) if leaf.kind not in arrays]


def frozen(array):
    array.flags.writeable = False
    return array


UNFIT = {
    "none": lambda array: None,
    "another type": lambda array: np.zeros(array.shape, np.int32),
    "a dimension more": lambda array: array[None],
    "objects": lambda array: array.astype(object),
    "another order of bytes": lambda array: array.astype(array.dtype.newbyteorder()),
    "not one after another": lambda array: np.repeat(array, 2, axis=0)[::2],
    "between the words": lambda array: (
        np.zeros(array.nbytes + 1, np.uint8)[1:].view(array.dtype).reshape(array.shape)
    ),
}
OF_NUMBERS = "another order of bytes", "between the words", "not one after another"
"""Not of records, of which there is one and whose size alone is checked."""


@pytest.mark.parametrize("name", sorted(ENTRIES))
def test_every_array_of_every_entry_is_checked(native, name):
    """One is wrong, all others are as small as may be: an error, before C sees it."""
    entry, call = ENTRIES[name], getattr(native, name)
    for i, leaf in arrays_of(entry):
        for kind, make in UNFIT.items():
            if kind not in OF_NUMBERS or leaf.least:
                given = given_for(entry, i, make, more=2)
                with pytest.raises((TypeError, ValueError), match=name):
                    call(*given)
        if leaf.written:
            with pytest.raises(TypeError, match="can be written"):
                call(*given_for(entry, i, frozen))
        for axis, least in enumerate(leaf.least):
            if least:
                short = lambda array, k=axis: np.zeros(  # noqa: E731
                    [size - (j == k) for j, size in enumerate(array.shape)]
                )
                with pytest.raises(ValueError, match=f"{name}: .* too small"):
                    call(*given_for(entry, i, short))


EDGES, TABLE = Robot.mir100().footprint.edges, np.zeros((3, 9))
CONTACTS = np.zeros(3 * CONTACT_SIZE)
WORLD = np.zeros((2, 2)), np.zeros((1, 12))
BEAMS, POSE, NONE = np.ones((4, 2)), (0.0, 0.0, 0.0), np.zeros((0, 4))
UNFITTING = {
    "contact_at": [(CONTACTS, 3), (CONTACTS, -1), (CONTACTS[:0], 0)],
    "contact_table": [(EDGES, 0.5, WORLD, 1.0, CONTACTS[:-1].copy())],
    "in_robot_frame": [(POSE, 0.0, WORLD, (WORLD[0], WORLD[1][:0]))],
    "fill_capsules": [
        (0, np.ones((1, 3)), BEAMS[:0], NONE, BEAMS, BEAMS, NONE, WORLD[1]),
        (0, np.ones((2, 3)), BEAMS, NONE, BEAMS, BEAMS, NONE, WORLD[1]),
        (0, NONE, BEAMS, NONE, BEAMS, BEAMS[:3], -np.ones((1, 4)), np.ones((9, 12))),
    ],
    "row_at": [(np.ones((3, 5)), place) for place in (-1.0, np.nan, 1e300)],
    "waiting_reference": [(np.ones((3, 5)), np.inf, POSE, POSE)],
    "fill_ahead": [(np.ones((3, 5)), 0.0, POSE, step, TABLE) for step in (-1.0, 1e9)],
    "cast_rays": [(BEAMS, WORLD, 0.0, np.ones(3))],
}
SETTINGS = AvoidanceSettings().record()
SEEN = np.array([(1.2, 0.1)]), WORLD[1][:0]


@pytest.mark.parametrize("name", UNFITTING)
def test_arguments_that_do_not_fit_together_are_refused(native, name):
    for given in UNFITTING[name]:
        with pytest.raises(ValueError, match=f"{name}: .* do not fit together"):
            getattr(native, name)(*given)


def refused(call, *given):
    with pytest.raises(ValueError, match=f"{call.__name__}: .* do not fit together"):
        call(*given)


FORGED = {
    "horizon": (-1.0, np.nan, np.inf, 1e9), "tick": (0.0, -1.0, np.nan, 1e-9),
    "dt": (0.0, -0.1, np.nan, 1e-9), "delay": (-1.0, np.nan, 1e3),
    "jitter": (-1.0, np.nan),
}  # fmt: skip


@pytest.mark.parametrize("key", FORGED)
def test_settings_that_count_nothing_are_refused(native, key):
    memory, rest = np.empty(100_000), (SEEN[0], SEEN[1], 0.0, True, 0.5, 0.0)
    for number in FORGED[key]:
        forged = SETTINGS.copy()
        forged[key] = number
        told = Setup(EDGES, GOOD, forged), Request(SEEN, 0.0, True, (0.5, 0.0))
        refused(native.filter_outcome, *told, NO_ANSWER, fresh_state(), memory)
        given = EDGES, GOOD, forged, *rest, fresh_state(), memory
        refused(native.filter_step, *given)
        kinds = np.ndarray, Decision, (), np.zeros((2, 3))
        with pytest.raises(ValueError, match="filter_step: .* do not fit together"):
            native.bind("filter_step", given, (7, 8, 3), kinds)


def test_what_is_asked_for_is_no_part_of_a_call(native):
    given = EDGES, GOOD, SETTINGS, *SEEN, 0.0, True, 0.5, 0.0, fresh_state(), np.ones(9)
    kinds = np.ndarray, Decision, (), np.zeros((2, 3))
    with pytest.raises(TypeError, match="asked for is to be known"):
        native.bind("filter_step", given, (7, 8, 0), kinds)


def test_a_stage_without_memory_or_with_a_forged_way_is_refused(native):
    given = GuideSettings(), AvoidanceSettings(), np.zeros(9)
    stage, state = Stage.of(Robot.mir100(), *given), fresh_stage()
    memory, ahead = stage_memory(1, stage.settings), np.zeros((1, 5))
    tracking = Tracking((0.5, 0.0), (1.0, 0.0, 0.0), 0.5, (0.5, 0.0), 0.02, ahead)
    assert native.guide_step(stage, state, memory, SEEN, tracking)[0] == 0
    unsolved, never = tracking._replace(ahead=ahead[:0]), tracking._replace(dt=0.0)
    refused(native.guide_step, stage, state, memory, SEEN, unsolved)
    refused(native.guide_step, stage, state, memory, SEEN, never)
    for place, number in ((COUNT, 121.0), (COUNT, -1.0), (ACTION, np.nan), (WAY, 99.0)):
        forged = fresh_stage()
        forged[COUNT] = 1.0
        forged[place] = number
        refused(native.guide_step, stage, forged, memory, SEEN, tracking)
    few = memory._replace(bodies=memory.bodies[:0])
    short = memory._replace(search=memory.search[:-1].copy())
    for less in (few, short):
        refused(native.guide_step, stage, state, less, SEEN, tracking)


def test_records_tuples_and_numbers_are_checked(native):
    with pytest.raises(TypeError, match="one record of the right type"):
        native.look_ticks(np.zeros(3))
    with pytest.raises(TypeError, match="tuple is wanted"):
        native.kanayama([0.0, 0.0, 0.0], (0.0, 0.0), (1.0, 1.0, 1.0))
    with pytest.raises(TypeError, match="more parts"):
        native.kanayama((0.0, 0.0), (0.0, 0.0), (1.0, 1.0, 1.0))
    with pytest.raises(TypeError, match="fewer parts"):
        native.kanayama((0.0,) * 4, (0.0, 0.0), (1.0, 1.0, 1.0))
    with pytest.raises(TypeError):
        native.wrap_angle("x")
    for given in ((), (GOOD, GOOD)):
        with pytest.raises(TypeError, match="takes 1 arguments, not"):
            native.limits_of(*given)
    with pytest.raises(OverflowError):
        native.most_predicted(2**40)


def test_no_reference_is_lost_or_kept(native):
    array, twist = GOOD.copy(), (0.25, -0.5)
    before = sys.getrefcount(array), sys.getrefcount(twist)
    for _ in range(1_000):
        native.limit_twist(array, twist, (0.0, 0.0), 0.02)
        with pytest.raises(TypeError):
            native.limit_twist(array, twist, None, 0.02)
    assert (sys.getrefcount(array), sys.getrefcount(twist)) == before
    array.resize(40, refcheck=False)  # no buffer is held


HELD = """
import sys
from qpavoid.compiled import native_code
from qpavoid.avoidance.step import filter_step
if native_code(filter_step.py_func) is None:
    sys.exit("no extension")
"""


@pytest.fixture(scope="module")
def package(native, tmp_path_factory):
    """A package of these very sources with its extension."""
    folder = tmp_path_factory.mktemp("package")
    ours = folder / "qpavoid"
    ours.mkdir()
    for path in PACKAGE.iterdir():
        if path.name in ("compiled.py", "stamps.py"):
            (ours / path.name).write_text(path.read_text())
        elif not path.name.startswith("_native"):
            (ours / path.name).symlink_to(path)
    (ours / "_native.abi3.so").symlink_to(native.__file__)
    (folder / "configs").symlink_to(ROOT / "configs")
    return folder


NO_NUMBA = """
import sys
sys.modules["numba"] = None
from dataclasses import replace
from pathlib import Path
from qpavoid import load_scenario
from qpavoid.cli import main
from qpavoid.lab.scenario.methods import REGISTRY
from qpavoid.lab.sensing.lidar import Lidar, LidarSettings
from qpavoid.lab.simulation.run import run
one = replace(load_scenario(sys.argv[1]), duration=0.1)
for method in [*REGISTRY, "qp-ahead+guide", "astar+qp"]:
    try:
        run(one, method)
    except Exception as error:
        if "pip install" not in str(error) or "numba" in str(error):
            raise
text = Path(sys.argv[1]).read_text().replace("duration_s = ", "duration_s = 0.5 #")
for name, more in {"scan": "", "points": "perception = false"}.items():
    Path(f"{name}.toml").write_text(f"{text}\\n[lidar]\\nbeams = 90\\n{more}")
    assert not main(["run", f"{name}.toml", "--out", "run", "--quiet"])
args = ["scan.toml", "--controllers", "eq5,qp,qp-ahead,dwa", "--out", "all"]
assert not main(["compare", *args, "--quiet"])
args = ["studies/smoke", "--out", "rows", "--workers", "1"]
assert not main(["sweep", *args, "--quiet"])
print("done")
"""


def in_package(folder, code, *given):
    """Output of an interpreter that has the package of a folder, not that of here."""
    environment = os.environ | {"PYTHONPATH": str(folder)}
    command = [sys.executable, "-P", "-c", code, *given]
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True
    )


@pytest.mark.long
def test_compare_run_and_sweep_do_without_numba(package):
    config = ROOT / "configs" / "paper" / "test_case_1.toml"
    done = in_package(package, NO_NUMBA, str(config))
    assert done.stdout.split()[-1:] == ["done"], done.stderr


def test_an_edited_source_runs_no_old_machine_code(package):
    file = package / "qpavoid" / "compiled.py"
    before = file.read_text()
    assert in_package(package, HELD).returncode == 0
    file.write_text(before + "# edited\n")
    try:
        done = in_package(package, HELD)
    finally:
        file.write_text(before)
    assert done.stderr.strip() == "no extension"


def test_without_extension_and_numba_one_is_told_what_to_install():
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "from qpavoid.model.kinematics import wrap_angle\n"
        "wrap_angle(7.0)"
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT), "QPAVOID_NATIVE": "0"}
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert "MissingExtraError" in done.stderr
    assert "pip install 'qpavoid[lab]'" in done.stderr


SANITIZED = """
import sys, importlib.util
spec = importlib.util.spec_from_file_location("_native", sys.argv[1])
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
sys.modules["qpavoid._native"] = module
import numpy as np
from hostile_filters import hostile
from hostile_filters import FILTERS, in_python
import qpavoid.guide.guide
from qpavoid.compiled import native_code
from qpavoid.avoidance.step import filter_step
assert native_code(filter_step.py_func) is module.filter_step
for name, (robot, settings, ahead, _) in FILTERS.items():
    in_python(robot, settings, ahead, hostile(np.random.default_rng(3), 400, robot))
from qpavoid import Guide, Obstacles, Robot
guide, pose = Guide(Robot.mir100()), (0.0, 0.0, 0.0)
guide.go_to(pose, (4.0, 0.0, 0.0))
walls = Obstacles(walls=[(1.5, -2.0, 1.5, 2.0), (-1.5, 2.0, 1.5, 2.0)])
for _ in range(300):
    d = guide.step(pose, walls.seen_from(pose))
    pose = module.arc(*pose, d.v, d.omega, 0.02)
for bad in (None, 1, "x", (), np.zeros(3, np.float32), np.zeros((0, 0))):
    for call in vars(module).values():
        if callable(call):
            for count in range(12):
                try:
                    call(*[bad] * count)
                except (TypeError, ValueError, OverflowError):
                    pass
print("clean")
"""


@pytest.mark.slow
@pytest.mark.skipif(COMPILER is None, reason="no system compiler")
def test_under_sanitizers_of_address_and_undefined_behaviour(tmp_path, native):
    stamps = dict(line.split() for line in native.STAMPS.splitlines())
    (tmp_path / "n.c").write_text(extension_text(ENTRIES, stamps))
    flags = [*FLAGS, *SHARED, "-g", "-fsanitize=address,undefined"]
    flags.append("-fno-sanitize-recover=all")
    compile_c([COMPILER], tmp_path, *flags, "n.c", "-o", "_native.abi3.so", "-lm")
    runtime = subprocess.run(
        [COMPILER, "-print-file-name=libasan.so"], stdout=-1, text=True, check=True
    ).stdout.strip()
    environment = os.environ | {
        "LD_PRELOAD": runtime,
        "ASAN_OPTIONS": "detect_leaks=0",
        "PYTHONPATH": os.pathsep.join(
            [str(ROOT), str(ROOT / "comparisons"), str(ROOT / "tests" / "support")]
        ),
    }
    command = [sys.executable, "-P", "-c", SANITIZED, str(tmp_path / "_native.abi3.so")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True)
    assert done.stdout.split() == ["clean"], done.stderr[-3000:]


OTHERS = {
    "aarch64-linux-gnu": ((), b"\x7fELF"),
    "x86_64-macos": (MACOS, bytes.fromhex("cffaedfe")),
    "aarch64-macos": (MACOS, bytes.fromhex("cffaedfe")),
}
"""Other targets of wheels: compiler flags, and first bytes of the file."""


@pytest.mark.slow
@pytest.mark.skipif(not zig(), reason="wants zig")
@pytest.mark.parametrize("target", OTHERS)
def test_it_compiles_for_other_machines(tmp_path, target):
    flags, begins = OTHERS[target]
    (tmp_path / "n.c").write_text(extension_text(ENTRIES, {}))
    told = [*FLAGS, *SHARED, *flags, "-Werror", "n.c", "-o", "n.so", "-lm"]
    compile_c([*zig(), "-target", target], tmp_path, *told)
    assert (tmp_path / "n.so").read_bytes().startswith(begins)


def copied(given):
    """Copies of all arrays of some arguments."""
    if isinstance(given, np.ndarray):
        made = given.copy()
        made.flags.writeable = given.flags.writeable  # else numba compiles another
        return made
    if not isinstance(given, tuple):
        return given
    parts = [copied(part) for part in given]
    return type(given)(*parts) if hasattr(given, "_fields") else tuple(parts)


def bits(given):
    """Kind and bits of all that arguments or results are made of."""
    if isinstance(given, np.ndarray):
        return given.tobytes()
    if isinstance(given, tuple):
        return type(given).__name__, *map(bits, given)
    if given is None or isinstance(given, bool | int):
        return type(given), given
    return type(given), "nan" if given != given else np.float64(given).tobytes()


def told(function, given):
    """Arguments that are only read, by their annotations."""

    def read(shape, one):
        if not shape.kind:
            parts = zip(shape.parts, one, strict=True)
            return tuple(x for part, value in parts for x in read(part, value))
        return () if shape.written else (bits(one),)

    return [
        x for pair in zip(shapes_of(function), given, strict=False) for x in read(*pair)
    ]


class Both:
    """Calls both codes of an entry, and compares what they return and write.

    Attributes:
        calls: How many so far.
        results: First parts of the results: of a filter's step its statuses.
    """

    def __init__(self, entry, native):
        self.entry, self.native = entry, native
        self.calls, self.results = 0, set()

    def __call__(self, *given):
        other, before = copied(given), told(self.entry.py_func, given)
        result = self.native(*given)
        right = self.entry.dispatcher(*other)
        assert bits(result) == bits(right), (self.entry.__name__, result, right)
        assert bits(given) == bits(other), self.entry.__name__
        assert told(self.entry.py_func, given) == before, self.entry.__name__
        self.calls += 1
        self.results.add(result[0] if isinstance(result, tuple) else result)
        return result
