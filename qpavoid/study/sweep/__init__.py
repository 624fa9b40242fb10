"""Sweeps: studies of any size, run on all cores or a cluster, stopped and resumed."""

from qpavoid.study.sweep.engine import sweep as sweep
