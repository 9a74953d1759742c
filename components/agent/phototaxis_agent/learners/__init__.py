"""Learners: one file each, found by name through the entry points `phototaxis.learners`."""
