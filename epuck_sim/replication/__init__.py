"""Claims of the thesis as data, the sweeps that test them, and the page with a verdict on each."""
