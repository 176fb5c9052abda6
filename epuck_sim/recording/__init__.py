"""Recordings of trials for rerun's viewer: written while a trial runs, read back, shown.

May import: trial, the models and scenario; never runs, sweep or statistics.
"""
