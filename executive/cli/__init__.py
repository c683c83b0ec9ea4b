"""The command line: console, inputs, outputs and options; one file per command."""
