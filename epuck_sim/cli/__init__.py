"""The `epuck-sim` command: parse, call, print.

May import everything; slow imports are inside functions, so that `--help` does not wait for them.
"""
