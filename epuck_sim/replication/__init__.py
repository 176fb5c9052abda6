"""Claims of the thesis as data, the sweeps that ask them, and the page with a verdict on each."""
