"""Scenarios, their runs, and the log of a run."""
