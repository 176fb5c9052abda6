"""Thousands of trials into a run folder, on all cores or on a cluster.

May import: runs and statistics, and what they may import.
"""
