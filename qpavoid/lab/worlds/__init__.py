"""Readers of files that others publish."""
