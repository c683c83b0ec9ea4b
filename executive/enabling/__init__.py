"""Enabling a robot for a task from a knowledge base: the search over alternatives, and its explanation."""
