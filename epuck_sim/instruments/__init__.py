"""The shipped measures, each a class that `measures.shipped` names.

May import: embodied, particles and what they may import; but what compiles or simulates only inside functions, because
`check` does neither.
"""
