"""Puts runs together: assembles robot, belief and worlds; runs, resumes and replays plans."""
