"""CasADi's integrators as methods of simulation, on the equations of `models.mechanism`."""
