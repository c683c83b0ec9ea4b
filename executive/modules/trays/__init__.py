"""Process module for objects that take two hands."""
