"""Tracking of rings in a film, their counts, and the time of synchrony."""
