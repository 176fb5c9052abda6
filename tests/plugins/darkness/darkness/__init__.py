"""Robots that walk in the dark, for epuck-sim."""
