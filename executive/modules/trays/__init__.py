"""The process module for what takes two hands."""
