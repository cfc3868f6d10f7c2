"""Other things to ask for than the smallest error over a known reference."""
