"""Timing: QP back ends on recorded problems, the filter call, and cold starts."""

from qpavoid.study.bench.recorded import record_problems
from qpavoid.study.bench.report import Report, write_report
from qpavoid.study.bench.run import bench
from qpavoid.study.bench.trials import time_back_ends

__all__ = ["Report", "bench", "record_problems", "time_back_ends", "write_report"]
