"""Helpers without knowledge of robots: output files, compilation, random numbers, messages, versions.

May import: errors, arrays, geometry, epuck, arena.
"""
