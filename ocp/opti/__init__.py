"""The optimal-control problem as `casadi.Opti`, that users extend: the equations by direct collocation, IPOPT."""
