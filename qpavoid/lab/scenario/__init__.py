"""Scenario files: keys, schema, worlds and plug-ins."""
