"""What commands do, below the command line and the library, which are two faces of it: arguments, checks, options."""
