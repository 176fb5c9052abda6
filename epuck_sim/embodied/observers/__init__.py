"""What can be known of robots from outside: which see which, and what they touch.

Observers put poses into a scene, a block of their own; the simulation's is left alone. May import: all of embodied but
`simulation` and what it alone imports.
"""
