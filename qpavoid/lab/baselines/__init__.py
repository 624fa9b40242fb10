"""Baselines from the literature, behind the same call as ours."""
