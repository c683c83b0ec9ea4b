"""Looking ahead: what an action leads to is a state, of which the validators of places are asked.

Each question is about something that the remaining steps need: that the base gets away, that a hand reaches in. They
are few and counted, so that equal runs ask the same.
"""
