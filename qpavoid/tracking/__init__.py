"""Reference motions: planned paths (Eq. 2, 3) and tracking (Eq. 6)."""
