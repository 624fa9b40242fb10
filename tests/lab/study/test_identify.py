"""Parameters of a base, recovered from drives with known parameters."""

import dataclasses
import math

import numpy as np
import pytest

from qpavoid.cli import main
from qpavoid.errors import InvalidInputError, QPAvoidError
from qpavoid.lab.scenario.scenario import load_scenario
from qpavoid.lab.sensing.plant import Plant
from qpavoid.lab.simulation.run import run
from qpavoid.lab.study.bags import BagWriter
from qpavoid.lab.study.identify import Response, bagged, drive_of, identify, paired

TRUE = {
    "delay": 0.11,
    "acceleration": 1.7,
    "angular_acceleration": 3.1,
    "slip": 0.04,
    "factor": 1.2,
}
FINE = 100


def simulated(seed, noise=(0.0, 0.0), dt=0.05, n=600, **changes):
    """A drive by small steps of time, which shares nothing with the fit.

    Commands jump every half second or so.
    """
    rng, true = np.random.default_rng(seed), TRUE | changes
    asked = np.zeros((n, 2))
    for k in range(0, n, 12):
        asked[k : k + 12] = rng.uniform([-0.5, -1.5], [1.0, 1.5])
    asked[:3] = 0.0
    driven, now, h = np.zeros((n, 2)), np.zeros(2), dt / FINE
    limits = np.array([true["acceleration"], true["angular_acceleration"]]) * h
    gains = np.array([1.0 - true["slip"], 1.0 / true["factor"]])
    for k in range(n):
        for i in range(FINE):
            heard = math.floor(k + (i + 0.5) / FINE - true["delay"] / dt)
            wanted = asked[max(heard, 0)]
            now = now + np.clip(wanted - now, -limits, limits)
            driven[k] += gains * now / FINE
    return Response(dt, asked, driven + rng.normal(0.0, 1.0, (n, 2)) * noise)


def test_without_noise_it_is_found_nearly_exactly():
    found = identify(simulated(0))
    for name, value in TRUE.items():
        assert getattr(found, name).value == pytest.approx(value, rel=0.03), name
    assert found.error.max() < 0.01


@pytest.mark.parametrize(
    ("drives", "least"), [(12, 11), pytest.param(40, 34, marks=pytest.mark.slow)]
)
def test_intervals_hold_what_is_true(drives, least):
    """Of 95 %: in drives of 30 s, of five numbers, at least 85 % of the time."""
    held = dict.fromkeys(TRUE, 0)
    for seed in range(drives):
        found = identify(simulated(seed, noise=(0.03, 0.06)))
        for name, value in TRUE.items():
            one = getattr(found, name)
            assert one.low <= one.value <= one.high
            assert one.value == pytest.approx(value, rel=0.25, abs=0.02), name
            held[name] += one.low <= value <= one.high
    assert min(held.values()) >= least, held


def test_what_a_drive_does_not_tell_is_said():
    drive = simulated(2, noise=(0.01, 0.02))
    straight = drive._replace(asked=drive.asked * [1.0, 0.0])
    straight.driven[:, 1] = 0.0
    found = identify(straight)
    assert (found.factor.low, found.factor.high) == (-math.inf, math.inf)
    assert found.acceleration.value == pytest.approx(TRUE["acceleration"], rel=0.1)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d._replace(asked=d.asked[:5], driven=d.driven[:5]), "20 finite"),
        (lambda d: d._replace(driven=d.driven * np.nan), "20 finite"),
        (lambda d: d._replace(asked=0.0 * d.asked), "commands that change"),
    ],
)
def test_bad_drives_are_refused(change, said):
    with pytest.raises(InvalidInputError, match=said):
        identify(change(simulated(0, n=60)))


@pytest.fixture(scope="module")
def log():
    case = load_scenario("paper/test_case_1")
    slow = Plant(lag=(0.05, 0.05))
    return run(dataclasses.replace(case, plant=slow, dt=0.02, duration=20.0), "qp")


def test_a_log_is_read_to_the_twists_that_were_driven(log):
    drive = drive_of(log)
    step, given = Plant(lag=(0.05, 0.05)).start(), []
    for v, omega in drive.asked:
        given.append(step(v, omega, 0.02).ground)
    np.testing.assert_allclose(drive.driven, given, atol=1e-9)
    found = identify(drive)
    assert 0.02 < found.delay.value < 0.1
    assert found.slip.value == pytest.approx(0.0, abs=0.03)
    assert found.factor.value == pytest.approx(1.0, abs=0.1)


def test_the_command_reads_logs_and_bags(tmp_path, log, capsys):
    log.save(tmp_path / "run.npz")
    assert main(["identify", str(tmp_path / "run.npz")]) == 0
    said = capsys.readouterr().out
    (row,) = (line for line in said.splitlines() if "delay " in line and "│" in line)
    assert [part.strip() for part in row.strip("│").split("│")][::3] == ["delay", "s"]
    assert "[actuation]" in said and "---" not in said
    pytest.importorskip("rosbags", reason="needs qpavoid[bags]")
    drive = simulated(0, noise=(0.01, 0.02))
    kinds = "geometry_msgs/msg/Twist", "nav_msgs/msg/Odometry"
    with BagWriter(tmp_path / "bag") as bag:
        for k, (asked, driven) in enumerate(zip(*drive[1:3], strict=True)):
            time = 1.7e9 + k * drive.dt
            twist, odom = bag.blank(kinds[0]), bag.stamped(kinds[1], time, "odom")
            twist.linear.x, twist.angular.z = asked
            odom.twist.twist.linear.x, odom.twist.twist.angular.z = driven
            middle = time + 0.5 * drive.dt  # of a step, whose mean is driven
            odom.header.stamp.sec = int(middle)
            odom.header.stamp.nanosec = round(middle % 1.0 * 1e9)
            bag.write("/cmd_vel", kinds[0], time + 1e-4, twist)
            bag.write("/odom", kinds[1], time + drive.dt, odom)
    found = identify(bagged(tmp_path / "bag"))
    assert found.delay.low <= TRUE["delay"] <= found.delay.high
    assert found.delay.value == pytest.approx(TRUE["delay"], abs=0.03)
    assert found.slip.value == pytest.approx(TRUE["slip"], abs=0.01)
    assert main(["identify", str(tmp_path / "bag")]) == 0
    assert main(["identify", str(tmp_path / "nothing.npz")]) == 1
    assert "nothing.npz: not readable arrays" in capsys.readouterr().err


def recorded(delay, hz, ramp=1.0, jitter=0.0, early=0.0, seed=0):
    """Commands (time, v, ω) at 20 Hz, and odometry (time, v, ω), by steps of 5 ms."""
    rng, h, told, seen = np.random.default_rng(seed), 0.005, [], []
    asked, now, due = [], np.zeros(2), 0.0
    limits = np.array([ramp, 2.0 * ramp]) * h
    for k in range(6000):
        if k % 200 == 0:
            wish = rng.uniform([-0.3, -1.0], [0.6, 1.0])
        if k % 10 == 0:
            told.append((k * h + early, *wish))
        if k * h >= due:
            seen.append((k * h, *now))
            due += (1.0 + rng.uniform(-jitter, jitter)) / hz
        asked.append(wish)
        heard = asked[max(0, k - round(delay / h))]
        now = now + np.clip(heard - now, -limits, limits)
    return np.array(told), np.array(seen)


@pytest.mark.parametrize("hz", [10, 20, 50])
@pytest.mark.parametrize(
    ("delay", "how"),
    [
        (0.1, {}),
        (0.05, {"ramp": 0.4}),
        (0.3, {"ramp": 3.0}),
        (0.2, {"jitter": 0.3}),
    ],
    ids=str,
)
def test_the_delay_is_told_by_odometry_of_any_rate(hz, delay, how):
    """Of the moment; no half period is lost."""
    found = identify(paired(*recorded(delay, hz, **how)))
    assert found.delay.low <= delay <= found.delay.high
    assert found.delay.value == pytest.approx(delay, abs=0.004)
    assert found.acceleration.value == pytest.approx(how.get("ramp", 1), rel=0.02)
    assert found.slip.value == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("scale", "early", "said"),
    [
        ([1, 0, 0], 0.0, "v that was driven does not follow"),
        ([1, 1, 0], 0.0, "ω that was driven does not follow"),
        ([1, math.nan, 1], 0.0, "not finite"),
        ([1, 1, 1], 0.5, "before it is commanded.* of two clocks"),
    ],
)
def test_odometry_that_tells_nothing_is_refused(scale, early, said):
    told, seen = recorded(0.1, 20, early=early)
    with pytest.raises(QPAvoidError, match=said):
        identify(paired(told, seen * scale))
