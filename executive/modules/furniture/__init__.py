"""Process modules for doors, drawers and devices, and for pushing."""
