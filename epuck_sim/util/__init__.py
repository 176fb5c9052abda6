"""Helpers without knowledge of robots: output files, compilation, random numbers, messages, versions."""
