"""The two-variable quadratic program: its statement, exact answer, and back ends."""
