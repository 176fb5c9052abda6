"""Reading of YAML into one validated, immutable scenario, and into the points of its sweep."""
