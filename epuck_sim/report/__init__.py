"""One page about a run folder, complete in itself: what was run, tables, figures, failed trials.

May import: everything but cli.
"""
