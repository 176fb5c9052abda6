"""Crowds of robots for epuck-sim: a measure and a scenario."""
