"""From a film to rings, their counts, and the time of synchrony."""
