"""Films: reading, writing, and the times of their frames."""
