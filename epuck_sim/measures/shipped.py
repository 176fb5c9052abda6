"""The measures that come with the package, by name; a further one is one more line, and its class in `instruments`."""

SHIPPED = {
    "order_parameter": "order:OrderParameter",
}
"""Module in `epuck_sim.instruments` and class of each shipped measure, by the measure's name."""
