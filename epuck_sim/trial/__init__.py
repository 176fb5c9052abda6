"""One seed to one TrialResult, whatever the model.

May import: embodied, particles and what they may import.
"""
