"""Methods that others would take, behind the same call as ours."""
