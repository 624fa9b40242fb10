"""Learning: environments over scenarios, with the filter as a shield."""
