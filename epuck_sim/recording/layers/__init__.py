"""What the viewer draws: from rows to rerun's entities."""
