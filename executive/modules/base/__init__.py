"""Process modules that move the base."""
