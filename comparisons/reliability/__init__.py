"""Studies of reliability: each module measures the rows of a table of the page."""
