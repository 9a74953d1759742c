"""The reproduction of the paper: the experiments, the claims that they test, and the page of results."""
