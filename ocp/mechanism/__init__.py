"""Any mechanism of bodies and tendons in compiled C: its exact inverse, and its response."""
