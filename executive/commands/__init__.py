"""What is done below :mod:`executive.api`: checks, compiling, sweeps."""
