"""Guide: a stage between tracking and filter that plans a detour after a stall."""
