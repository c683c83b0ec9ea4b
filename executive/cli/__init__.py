"""The command line: console, arguments and inputs; one file per command."""
