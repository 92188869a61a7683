"""Queue, executor, stub, supervisor, recovery, journal; imports no policy."""
