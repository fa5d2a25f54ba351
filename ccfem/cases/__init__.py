"""Cases: ready problems, one file a case."""
