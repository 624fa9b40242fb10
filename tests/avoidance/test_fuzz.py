"""No call whatever breaks the exported filter, under sanitizers."""

import pytest

from export_problems import CAPACITY
from fuzz import FILTERS, fuzzed, in_c
from in_c import COMPILER, STRICT
from qpavoid.errors import QPAvoidError
from qpavoid.export.write import export_c
from timing.exported import compile_replay

SANE = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g")


@pytest.mark.slow
@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("name", FILTERS)
def test_no_call_breaks_the_exported_filter(name, tmp_path):
    robot, settings, ahead = FILTERS[name]
    export_c(tmp_path, robot, settings, CAPACITY, ahead)
    try:
        program = compile_replay(tmp_path, [*STRICT, *SANE])
    except QPAvoidError as why:
        assert "sanit" in str(why) or "asan" in str(why), why
        pytest.skip("no sanitizers")
    seen = set()
    for seed in range(3):
        problems = fuzzed([seed, len(name)], 5_000, robot)
        answers, bad, last = in_c(program, robot, problems)
        assert len(answers) == len(problems)
        assert not bad.any(), (answers[bad][:3], last[bad][:3])
        seen |= set(answers["status"].tolist())
    assert seen >= {-1, 1, 2}
