"""Process modules that look at, search for and explore."""
