"""How things are shown on pages: HTML, pictures of the arena, numbers. Loads nothing heavy."""
