"""The rankings of a report."""

from packed import row
from qpavoid.lab.study.report.ranking import name_methods, rank


def test_methods_are_named_after_all_that_makes_them():
    named = name_methods(
        [
            row(),
            row(solver="osqp"),
            row(**{"filter.gamma_per_s": 2.0, "path.gamma_per_s": 1.0}),
            row(**{"filter.dt_s": 0.05}),
        ]
    )
    assert [x["method"] for x in named] == [
        "qp",
        "qp (osqp)",
        "qp, filter.gamma_per_s 2, path.gamma_per_s 1",
        "qp, dt_s 0.05",
    ]


def test_ranking_is_by_success_then_contacts_then_time():
    rows = [
        *(row("slow", arrived_s=9.0, seed=i) for i in range(4)),
        *(row("fast", arrived_s=3.0, seed=i) for i in range(4)),
        *(row("rough", success=i > 0, contact=i < 1, seed=i) for i in range(4)),
        *(row("stuck", success=i > 0, seed=i) for i in range(4)),
        *(row("lost", success=False, min_clearance_m=None) for i in range(4)),
    ]
    records = rank(name_methods(rows))
    names = [record["method"] for record in records]
    assert names == ["fast", "slow", "stuck", "rough", "lost"]
    assert records[0]["time"] == 3.0
    assert records[-1]["time"] is records[-1]["clearance"] is None
