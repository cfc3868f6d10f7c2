"""How a profile is searched: quadratic programs, grids of knots, windows."""
