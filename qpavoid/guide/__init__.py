"""Guide: a stage between tracking and filter that scores candidate motions."""
