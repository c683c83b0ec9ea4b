"""Process modules of grippers, and for handing over."""
