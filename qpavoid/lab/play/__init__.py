"""The filter live in a browser: drag obstacles, change settings, record scenarios."""
