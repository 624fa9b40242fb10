"""Global planning: a path on an inflated grid, planned again when blocked."""
