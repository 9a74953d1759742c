"""What happened, in Rerun: live and on disk."""
