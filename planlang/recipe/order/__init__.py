"""Orders of steps: their graph, what follows from it, and how it splits into series, parallels and location scopes."""
