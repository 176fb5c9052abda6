"""What a controller is, how its file is found and loaded, and how a group of robots runs it."""
