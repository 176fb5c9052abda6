"""The `epuck-sim` command: parse, call, print.

May import everything, inside its functions where that takes long: `--help` waits for nothing.
"""
