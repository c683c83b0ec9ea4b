"""Process modules: they perform primitive actions on the platform."""
