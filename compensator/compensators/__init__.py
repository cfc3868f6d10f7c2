"""Ways from a desired tension to a force."""
