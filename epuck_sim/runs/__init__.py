"""The run folder: the results of a sweep on disk, how they are stored, read and exported."""
