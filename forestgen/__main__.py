"""`python -m forestgen` is the command."""

from forestgen.cli import main

main()
