"""The arena and its laws in plain numbers: shapes, lines of sight, rules for a sound world."""
