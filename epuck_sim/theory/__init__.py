"""What the graph of who hears whom says of a swarm before any trial: its regimes, and T_sync in its limits."""
