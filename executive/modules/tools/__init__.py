"""Process modules for motions under constraints: pouring, stirring, wiping."""
