"""One page about a run folder, complete in itself: what was run, tables, figures that can be zoomed, failed trials.

May import: everything but cli.
"""
