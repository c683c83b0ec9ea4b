"""Process modules that move one arm, empty or with what it holds."""
