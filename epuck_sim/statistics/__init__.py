"""Censored synchronisation times, their curves over speed, and scaling laws.

May import: runs and what it may import; never sweep.
"""
