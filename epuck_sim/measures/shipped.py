"""The measures that come with the package, by name; a further one is one more line, and its class in `instruments`."""

SHIPPED = {
    "cluster_count": "clusters:ClusterCount",
    "flashes_seen": "sightings:FlashesSeen",
    "largest_cluster": "clusters:LargestCluster",
    "mean_squared_displacement": "motion:MeanSquaredDisplacement",
    "near_walls": "motion:NearWalls",
    "neighbour_change": "neighbours:NeighbourChange",
    "order_parameter": "order:OrderParameter",
}
"""Module in `epuck_sim.instruments` and class of each shipped measure, by the measure's name."""
