"""The paper's experiments: what is run, which claim it answers, and the page that says so."""
