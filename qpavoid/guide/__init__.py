"""The guide: a stage between tracking and filter that weighs the coming seconds."""
