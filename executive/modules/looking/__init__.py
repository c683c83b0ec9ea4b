"""Process modules that look, search and explore."""
