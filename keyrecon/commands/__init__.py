"""What can be typed: one function per command, in modules that import what it is declared with."""
