"""Bodies: who may touch something, and Chipmunk, which moves those; may import `swarm`, `cells` and below."""
