"""`python -m epuck_sim` is `epuck-sim`."""

from epuck_sim.cli import main

main()
