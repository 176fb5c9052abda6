"""The forms in which `plot` draws a sweep, each with the table of its numbers."""
