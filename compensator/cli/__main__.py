"""`python -m tendonff.compensator.cli`."""

from tendonff.compensator.cli import main

main()
