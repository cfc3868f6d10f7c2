"""The time-stepping scheme, as coefficients: second-order backward differences (BDF2).

A step ends at x = base + H dx/dt with base = x_n + carry (x_n - x_{n-1}) and H = weight h. Against a 10 us run of the
finger example the scheme leaves a tenth of implicit Euler's error at the same cost (`benchmarks/simulate.py`); it is
L-stable like implicit Euler. Where no earlier state exists, and in the pieces of a step that had to be split, implicit
Euler (carry 0, weight 1) takes its place. After a step of another length, r times as long as the one before, carry is
r^2/(1 + 2 r) and weight (1 + r)/(1 + 2 r), see MOST_RATIO. Hairer, Wanner, Solving Ordinary Differential Equations
II, section V.1.
"""

BDF2_CARRY = 1 / 3
BDF2_WEIGHT = 2 / 3

MOST_RATIO = 4.0
"""Largest r of a controller whose steps differ; implicit Euler beyond. A constant r above 2.4 would be unstable, but
steps do not grow without end: over two that alternate, as 5 and 15 ms do, an error falls to r/((1 + 2 r)(2 + r)) <= 1/9
of itself."""

RESIDUAL_TOLERANCE_N = 5e-12
"""Largest force balance that counts as solved [N]."""

RESIDUAL_ROUNDING = 5e-14
"""Relative addition to the tolerance: rounding of the largest link force."""

EASY_CONTRACTION, EASY_MOVES, EASY_GOAL = 0.1, 8, 0.01
"""A step is easy when Newton's method solves it with the matrix of the guess: it goes on for so many moves at most, as
long as each takes the largest balance down by the first factor, to the last factor times the tolerance, so that little
is left to add up over many steps. What is above the tolerance then is tried again from the guess, with a new matrix for
every move and a line search."""

MAX_ITERATIONS = 50
MAX_HALVINGS = 30
MAX_SPLITS = 20
"""A step that does not converge is split into pieces of half its length; a piece is halved at most this often."""

MAX_PIECES = 20_000
"""A step that was split is given up after so many pieces: one that needs more has no solution worth its time."""
