"""Computing times of solvers and control steps, beside those of other software.

python comparisons/timing/solvers.py       # QP solvers on recorded problems
python comparisons/timing/steps.py         # whole control steps
"""
