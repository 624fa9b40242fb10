"""Sweeps: studies of any size, run on all cores or a cluster, stopped and resumed."""

from qpavoid.lab.study.sweep.engine import sweep as sweep
