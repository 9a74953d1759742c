"""Records runs with Rerun: as a live view and as files."""
