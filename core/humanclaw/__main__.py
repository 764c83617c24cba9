"""`python -m humanclaw` is the console script `humanclaw`."""

from humanclaw.cli import main

main()
