"""What a measure of a trial is: finds it by name or in its file, and checks its parameters.

May import: control and what it may import.
"""
