"""Timing: QP solvers on recorded problems, whole steps, and cold starts."""

from timing.recorded import record_problems
from timing.report import Report, write_report
from timing.run import bench

__all__ = ["Report", "bench", "record_problems", "write_report"]
