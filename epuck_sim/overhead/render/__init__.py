"""From a trial to the pictures that a camera above the arena takes."""
