"""Runs of scenarios, and the log of a run."""
