"""Chapters 3 and 5: point-like agents with oscillators, simulated from event to event."""
