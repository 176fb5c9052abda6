"""Predictions from the graph of who hears whom, before any trial: regimes, and T_sync in its limits."""
