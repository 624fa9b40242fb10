"""How the timing bench counts: answers, faults, turns, budgets. No time is judged."""

import gc
import math
import time
from collections import Counter
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from qpavoid.qp.solve import load_back_end
from small_bench import SMALL
from timing.recorded import record_problems
from timing.report import pivot
from timing.trials import (
    BLOCK,
    QUICK,
    Case,
    Contender,
    Plan,
    Trials,
    judge,
    of_back_end,
    quantile,
    race,
)


@pytest.fixture(scope="module")
def bank():
    problems = record_problems(20, QUICK.problems)
    return [Case(p.scaled, p.optimum, p.scaled.scale) for p in problems]


def feasible(cases):
    return [case for case in cases if np.isfinite(case.answer).all()]


def contend(answer):
    return Contender(answer, np.asarray)


# ------------------------------------------------------------------ how it is counted
def test_an_answer_is_compared_in_metres_and_radians(bank):
    one, trials = feasible(bank)[0], Trials()
    trials.call(contend(lambda q: one.answer + (0.0, 2e-5) * one.scale), one)
    trials.call(contend(lambda q: np.full(2, math.nan)), one)
    impossible = next(case for case in bank if np.isnan(case.answer).any())
    trials.call(contend(lambda q: np.zeros(2)), impossible)
    assert trials.errors[0] == pytest.approx(2e-5, rel=1e-6)
    assert math.isnan(trials.errors[1]) and trials.errors[2] == math.inf
    assert len(trials.cases) == 2 and min(trials.times) > 0
    assert trials.spent_s == pytest.approx(1e-9 * sum(trials.times))


def test_judge_counts_wrong_missing_and_false_answers():
    timed = Trials([0.0, 0.9e-5, 2e-5, math.nan], [1000, 2000, 4000, 3000], {1, 2, 3})
    row = judge(timed, Trials([math.inf, math.nan], [5000, 7000]))
    assert (row["problems"], row["calls"]) == (3, 4)
    assert (row["median_us"], row["max_us"]) == (2.5, 4.0)
    assert row["p99_us"] is None and row["p999_us"] is None
    assert (row["wrong"], row["false_ok"], row["false_infeasible"]) == (1, 2, 1)
    assert row["worst_error"] == 2e-5 and row["error_p99"] == pytest.approx(2e-5, 0.05)
    assert (row["infeasible_calls"], row["infeasible_max_us"]) == (2, 7.0)


def test_judge_says_where_nothing_was_measured():
    row = judge(Trials(), Trials())
    for key in ("median_us", "p99_us", "max_us", "worst_error", "infeasible_max_us"):
        assert row[key] is None
    assert row["calls"] == row["wrong"] == row["false_ok"] == 0


def test_a_table_has_no_faults_where_none_were_counted():
    row = {"median_us": 1.0, "p999_us": 2.0, "rows": 5, "calls": 200}
    faults = "wrong", "false_ok", "false_infeasible"
    counted = row | {"who": "a", "infeasible_calls": 0} | dict.fromkeys(faults, 1)
    uncounted = row | {"who": "b", "infeasible_calls": 0} | dict.fromkeys(faults)
    *_, first, second, _ = pivot("QP", [counted, uncounted], "who", "rows")
    assert first.endswith("| 0.5 % | 0.5 % | 0.5 % |")
    assert second.endswith("| – | – | – |")


def test_a_quantile_takes_enough_calls():
    assert quantile(np.arange(98.0), 0.99) is None
    assert quantile(np.arange(99.0), 0.99) == pytest.approx(97.02)
    assert quantile(np.arange(900.0), 0.999) is None
    assert quantile(np.array([3.0]), 0.5) == 3.0


def raising(problem):
    raise RuntimeError("no")


def test_an_answer_that_casadi_disowns_is_none(bank):
    class Plugin:
        def __init__(self, success):
            buffer = SimpleNamespace(stats=lambda: {"success": success})
            self.last = SimpleNamespace(buffer=buffer)

        def __call__(self, problem):
            return np.zeros(2)

    for success in (True, False):
        one = Trials()
        one.call(of_back_end(Plugin(success)), bank[0])
        assert math.isnan(one.errors[0]) != success


def test_liars_refusers_and_raisers_are_found_out(bank):
    exact = load_back_end("exact")
    contenders = {
        "exact": of_back_end(exact),
        "liar": contend(lambda problem: np.nan_to_num(exact(problem)) + 1e-3),
        "refuser": contend(lambda problem: np.full(2, math.nan)),
        "raiser": contend(raising),
    }
    rows = race(contenders, bank, SMALL)
    count = len(feasible(bank))
    assert {row["calls"] for row in rows.values()} == {count}
    assert {row["infeasible_calls"] for row in rows.values()} == {3}
    faults = {
        name: (row["wrong"], row["false_infeasible"], row["false_ok"])
        for name, row in rows.items()
    }
    assert faults == {
        "exact": (0, 0, 0),
        "liar": (count, 0, count + 3),
        "refuser": (0, count, 0),
        "raiser": (0, count, 0),
    }


def test_every_block_is_led_in_by_the_case_before_it(bank):
    cases = feasible(bank)
    order = {id(case.question): i for i, case in enumerate(cases)}
    met = []

    def witness(question):
        met.append(order[id(question)])
        return np.zeros(2)

    row = race({"witness": contend(witness)}, cases, SMALL)["witness"]
    count = len(order)
    assert row["problems"] == count
    assert Counter(met) == Counter(
        [*range(count), *((i - 1) % count for i in range(0, count, BLOCK))]
    )
    jumps = [(a, b) for a, b in pairwise(met) if b != (a + 1) % count]
    assert len(jumps) <= math.ceil(count / BLOCK)


def test_contenders_take_turns(bank):
    said = []
    names = ("one", "two", "three")
    contenders = {
        n: contend(lambda q, n=n: said.append(n) or np.zeros(2)) for n in names
    }
    race(contenders, feasible(bank), SMALL)
    turn = (BLOCK + 1) * len(names)
    for start in range(0, 3 * turn, turn):
        assert set(said[start : start + turn]) == set(names)


def test_a_slow_contender_gets_fewer_cases_and_the_others_all(bank):
    slow = contend(lambda problem: time.sleep(0.01) or np.zeros(2))
    plan = Plan(
        50, passes=1, budget_s=0.03, infeasible=3, scans=1, calls=1, slack_rows=5
    )
    rows = race(
        {"slow": slow, "exact": of_back_end(load_back_end("exact"))}, bank, plan
    )
    assert 1 <= rows["slow"]["calls"] <= 2 * BLOCK
    assert rows["exact"]["calls"] == len(feasible(bank))


def test_the_garbage_collector_is_off_meanwhile_and_on_again(bank):
    seen = []
    witness = contend(lambda problem: seen.append(gc.isenabled()) or np.zeros(2))
    race({"witness": witness}, bank, SMALL)
    assert gc.isenabled() and seen and not any(seen)
