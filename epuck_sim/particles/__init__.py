"""Oscillators without bodies: the event-driven model of thesis chapters 3 and 5."""
