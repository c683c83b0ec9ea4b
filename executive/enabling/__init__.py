"""What a robot lacks for a task, and where it can be had: the search over alternatives, and its explanation."""
