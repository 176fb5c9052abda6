"""Rendering of a trial as the pictures that a camera above the arena takes."""
