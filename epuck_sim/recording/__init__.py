"""Recordings of trials for the rerun viewer: written, read back, replayed and drawn."""
