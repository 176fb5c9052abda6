"""What a measure of a trial is, how it is found by name or in its file, and the shipped ones."""
