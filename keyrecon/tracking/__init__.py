"""Where the player is: camera motion, colours, radial symmetry, Viterbi path, background."""
