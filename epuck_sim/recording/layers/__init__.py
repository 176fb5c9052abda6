"""What the viewer draws: rows of a trial as rerun's entities."""
