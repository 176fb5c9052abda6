"""Bodies: who may touch whom, and Chipmunk, the engine inside pymunk, which moves who does.

May import: `swarm`, `cells`, the scenario, the arena and util; never sensors, controllers or the loop.
"""
