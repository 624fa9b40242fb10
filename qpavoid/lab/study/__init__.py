"""Metrics, tables, figures and timings of runs."""
