"""What is done below :mod:`executive.api`: checks, compiling, sweeps; and what the machine has to have for it."""
