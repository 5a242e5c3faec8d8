"""`python -m keyrecon`: the command line where its script is not on the path."""

from keyrecon.cli import main

if __name__ == "__main__":  # worker processes import this module too
    main()
