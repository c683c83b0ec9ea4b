"""Enabling a robot for a task with what a knowledge base has: the search over alternatives, and its explanation."""
