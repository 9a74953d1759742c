"""What a process needs to take part: sessions, the bus, options, errors, files and the step protocol."""
