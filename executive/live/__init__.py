"""A run that people watch while it goes on: in a page that can hold it, or as a tree in the terminal."""
