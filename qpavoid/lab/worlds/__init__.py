"""Worlds: readers of published data sets, and generators."""
