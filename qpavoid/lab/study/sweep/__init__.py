"""Studies: thousands of runs on all cores, none done twice."""
