"""The run folder: the results of a sweep on disk, how they are stored, read and exported.

May import: trial and what it may import.
"""
