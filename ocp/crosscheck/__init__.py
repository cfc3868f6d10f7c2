"""How far a simulation can be trusted: step halving, and adaptive integrators on the same equations.

Where a stiff bristle meets friction that falls with speed, neighbouring trajectories part: the result then depends on
the step, the tolerance and the last digit of the force, and no solver converges point by point. Both checks look for
that and say how wide the spread is.
"""
