"""Grounds and runs plans with a robot in a world; the outermost layer, and the only one that a user starts.

General layout: ``cli`` is the command, with its edges to files and people. ``runs`` puts a run together from ``robots``
(what a robot is and can), ``belief`` (what is believed), ``locations`` (where to stand and reach), ``motion`` (how to
get there) and ``modules`` (who does it). ``pictures`` draws and records what happened.
"""
