"""The figures, and the table beside each.

May import: statistics, runs, recording.reader, overhead.track and what they may import.
"""
