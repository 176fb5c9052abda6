"""The camera above the arena (thesis 4.3): films of trials, and the tracker of flashes in any film.

May import: recording, to film recorded trials; trial, the models and scenario; never runs, sweep or statistics.
"""
