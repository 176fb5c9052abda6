"""The figures, and the table beside each.

May import: statistics, runs, recording, overhead.track and what they may import.
"""
