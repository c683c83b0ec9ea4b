"""Further tasks: devices, doors that stand side by side, and things that are hard to find or to get at."""
