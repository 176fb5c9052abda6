"""Measures of a trial: their interface, how they are found by name or in a file, and the shipped ones."""
