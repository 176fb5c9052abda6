"""The camera above the arena (thesis 4.3): films of simulated trials, and a tracker of flashes for any film."""
