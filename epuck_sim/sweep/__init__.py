"""Run thousands of trials into a run folder, on all cores or on a cluster."""
