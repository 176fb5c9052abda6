"""Controllers: their interface, how their files are found and loaded, and how a group of robots runs them."""
