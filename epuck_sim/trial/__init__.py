"""One seed to one TrialResult, whatever the model."""
