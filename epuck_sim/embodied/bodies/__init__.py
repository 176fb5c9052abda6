"""Bodies: which robots may touch something, and Chipmunk, the engine inside pymunk, which moves those.

May import: `swarm`, `cells`, the scenario, the arena and util; never sensors, controllers or the loop.
"""
