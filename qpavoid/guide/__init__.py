"""No stall: a stage between tracking and the filter that leads round what is near."""
