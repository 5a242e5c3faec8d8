"""Where the player is: camera motion, colours, radial symmetry, filters, Viterbi path."""
