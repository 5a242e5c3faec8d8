"""The mathematics that several stages share: each method once, each with a slow twin in its test."""
