"""Rows of a report."""

HOSTILE = 'A </script><script>boom()</script> <b>disc</b> & "quotes"'


def row(controller="qp", success=True, **more):
    return {
        "run": f"{controller}-{more.get('seed', 0)}",
        "scenario": "s",
        "seed": 0,
        "controller": controller,
        "solver": "exact",
        "outcome": "arrived" if success else "stalled",
        "success": success,
        "contact": False,
        "arrived_s": 4.0 if success else None,
        "min_clearance_m": 0.2,
        **more,
    }
