"""Process modules of grippers, and handing over."""
