"""A bench that is done in seconds."""

from timing.trials import Plan

SMALL = Plan(50, passes=1, budget_s=60.0, infeasible=3, scans=4, calls=2, slack_rows=5)
