"""Detours: a stage between tracking and filter that searches a way when stalled."""
