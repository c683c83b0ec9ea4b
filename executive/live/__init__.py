"""Watch a run live: on a web page that can pause it, or as a tree in the terminal."""
