"""Process modules for doors, drawers, devices and what is pushed."""
