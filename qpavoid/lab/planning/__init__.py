"""Global plans: a path on an inflated grid, and another one when it is blocked."""
