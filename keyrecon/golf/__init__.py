"""The golf swing: a motion model learnt from captured swings, fitted to an ordinary video."""
