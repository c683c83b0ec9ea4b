"""Process modules that move one arm, with or without a held object."""
