"""Which robots or agents see, touch or receive which."""
