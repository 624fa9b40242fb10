"""Timing: QP solvers on recorded problems, whole steps, and cold starts."""

from qpavoid.study.bench.recorded import record_problems
from qpavoid.study.bench.report import Report, write_report
from qpavoid.study.bench.run import bench

__all__ = ["Report", "bench", "record_problems", "write_report"]
