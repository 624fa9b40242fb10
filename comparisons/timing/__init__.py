"""Computing times of solvers and control steps, beside those of other software."""
