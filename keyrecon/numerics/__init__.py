"""The mathematics that several stages share, each method once."""
