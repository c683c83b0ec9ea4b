"""Process modules, which perform primitive actions on the platform."""
