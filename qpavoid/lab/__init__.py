"""The laboratory: what tests what goes onto a robot."""
