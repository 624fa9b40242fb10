"""The filter as one C99 source, translated from the package's own functions."""
