"""Who sees, touches or receives whom."""
