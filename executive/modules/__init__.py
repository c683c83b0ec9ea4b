"""Process modules: what performs primitive actions on the platform, one file each."""
