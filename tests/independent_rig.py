"""A rig written for these tests alone: another discretisation, another scheme, no code of the packages.

Masses in the middle of N equal pieces, half links at the ends; linearly implicit Euler at 10 microseconds with the
slopes of the last step, one tridiagonal solve a step, no iteration.
"""

import copy
import ctypes
import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tendonff.models.parameters import Transmission
from tendonff.ocp.codegen.compiler import load_library

Array = NDArray[np.float64]

SOURCE = r"""
#include <math.h>
#define MAX 128
typedef struct {
    int n;
    double h, k1, k2, tau, c, mass, viscous, sigma, adhesion; /* of the whole tendon */
    double ma, ba, ml, bl, kl, anchor;       /* anchor: tension of the load's spring at q_l = 0 */
    double mu_pull, mu_release, angle, gear; /* gear: dry friction of the drive [N] */
    double exponent, level;                  /* friction falls as (tension / level)^-exponent */
    double gear_force, spot[MAX];            /* spot: factor on friction of each mass, 0 means 1 */
    double v[MAX], e[MAX], z[MAX], fs[MAX], qa, ql, tension;
} rig;

void rig_start(rig *r, double tension)
{
    int i, n = r->n;
    for (i = 0; i < n + 2; i++) r->v[i] = 0;
    for (i = 0; i <= n; i++) { double k = r->k1 * n * ((i == 0 || i == n) ? 2 : 1); r->e[i] = r->z[i] = tension / k; }
    for (i = 0; i < n; i++) r->fs[i] = 0;
    r->qa = r->ql = 0; r->tension = tension; r->gear_force = 0;
}

void rig_advance(rig *r, double force_from, double force_to, int steps)
{
    int n = r->n, i, s;
    double a[MAX], b[MAX], d[MAX], x[MAX], k[MAX], f0[MAX], g[MAX], h = r->h, bar_pull[MAX], bar_release[MAX];
    double keep[MAX], inverse[MAX]; /* divisions take most of a step: each is done once */
    for (i = 1; i <= n; i++) {
        double spot = r->spot[i - 1] > 0 ? r->spot[i - 1] : 1;
        bar_pull[i] = tanh(spot * r->mu_pull * r->angle / n / 2);
        bar_release[i] = tanh(spot * r->mu_release * r->angle / n / 2);
    }
    for (s = 1; s <= steps; s++) {
        double force = force_from + (force_to - force_from) * s / steps;
        for (i = 0; i <= n; i++) {            /* tension at the end of the step: f0 + g (v_i - v_{i+1}) */
            double share = n * ((i == 0 || i == n) ? 2.0 : 1.0), w = h / (r->tau + h);
            double k1 = r->k1 * share, k2 = r->k2 * share;
            f0[i] = k1 * r->e[i] + k2 * (1 - w) * (r->e[i] - r->z[i]);
            g[i] = k1 * h + k2 * (1 - w) * h + r->c * share;
            k[i] = f0[i] + g[i] * (r->v[i] - r->v[i + 1]); /* with the last velocities: for the normal force */
        }
        d[0] = r->ma / h + r->ba + g[0]; b[0] = -g[0]; x[0] = r->ma / h * r->v[0] + force - f0[0]; a[0] = 0;
        if (r->gear > 0) { /* a bristle of 10 um */
            double stiff = r->gear / 1e-5, held = 1 / (1 + stiff * h * fabs(r->v[0]) / r->gear);
            d[0] += held * stiff * h; x[0] -= held * r->gear_force;
        }
        for (i = 1; i <= n; i++) {
            double normal = k[i - 1] + k[i] + 2 * r->adhesion, v = r->v[i], bar = v >= 0 ? bar_pull[i] : bar_release[i];
            double sigma = r->sigma / n, most;
            if (r->exponent > 0) bar *= pow((normal > 1e-3 ? normal : 1e-3) / 2 / r->level, -r->exponent);
            most = bar * (normal > 1e-9 ? normal : 1e-9);
            keep[i] = most / (most + sigma * h * fabs(v)); /* f_s = keep (f_s + sigma h v) */
            a[i] = -g[i - 1]; b[i] = -g[i];
            d[i] = r->mass / n / h + r->viscous / n + keep[i] * sigma * h + g[i - 1] + g[i];
            x[i] = r->mass / n / h * v + f0[i - 1] - f0[i] - keep[i] * r->fs[i - 1];
        }
        a[n + 1] = -g[n]; b[n + 1] = 0;
        d[n + 1] = r->ml / h + r->bl + r->kl * h + g[n];
        x[n + 1] = r->ml / h * r->v[n + 1] + f0[n] - r->anchor - r->kl * r->ql;
        for (i = 1; i <= n + 1; i++) {
            double w = a[i] * (inverse[i - 1] = 1 / d[i - 1]);
            d[i] -= w * b[i - 1]; x[i] -= w * x[i - 1];
        }
        x[n + 1] /= d[n + 1];
        for (i = n; i >= 0; i--) x[i] = (x[i] - b[i] * x[i + 1]) * inverse[i];
        for (i = 1; i <= n; i++) r->fs[i - 1] = keep[i] * (r->fs[i - 1] + r->sigma / n * h * x[i]);
        if (r->gear > 0) {
            double stiff = r->gear / 1e-5;
            r->gear_force = (r->gear_force + stiff * h * x[0]) / (1 + stiff * h * fabs(x[0]) / r->gear);
        }
        for (i = 0; i <= n; i++) {
            double rate = x[i] - x[i + 1], w = h / (r->tau + h);
            r->e[i] += h * rate;
            r->z[i] += w * (r->e[i] - r->z[i]);
        }
        r->tension = f0[n] + g[n] * (x[n] - x[n + 1]);
        for (i = 0; i < n + 2; i++) r->v[i] = x[i];
        r->qa += h * x[0];
        r->ql += h * x[n + 1];
    }
}
"""

_MOST = 128
_NUMBERS = (
    *("h", "k1", "k2", "tau", "c", "mass", "viscous", "sigma", "adhesion", "ma", "ba", "ml", "bl", "kl", "anchor"),
    *("mu_pull", "mu_release", "angle", "gear", "exponent", "level", "gear_force"),
)


class _Rig(ctypes.Structure):
    _fields_ = (
        ("n", ctypes.c_int),
        *((name, ctypes.c_double) for name in _NUMBERS),
        *((name, ctypes.c_double * _MOST) for name in ("spot", "v", "e", "z", "fs")),
        *((name, ctypes.c_double) for name in ("qa", "ql", "tension")),
    )


@functools.cache
def _library() -> ctypes.CDLL:
    return load_library(SOURCE)


@dataclass
class Rig:
    """The rig: what it really is, by factors on the scenario's values, and how it is measured."""

    transmission: Transmission
    initial_tension_N: float
    mu: float = 1.0
    bristle: float = 1.0
    stiffness: float = 1.0
    load: float = 1.0
    release: float = 1.0  # on friction when releasing, beside `mu`
    gear_N: float = 0.0  # dry friction of the drive
    load_exponent: float = 0.0  # friction falls with the tension: mu (T / reference_tension_N)^-load_exponent
    reference_tension_N: float | None = None  # default: the tension at the start
    masses: int = 40
    step_s: float = 1e-5
    true_tension_N: float | None = None
    _rig: _Rig = field(init=False)

    def __post_init__(self) -> None:
        t = self.transmission
        start = self.initial_tension_N if self.true_tension_N is None else self.true_tension_N
        self._rig = _Rig(
            self.masses,
            self.step_s,
            t.tendon.stiffness_N_per_m * self.stiffness,
            t.tendon.relaxing_stiffness_N_per_m * self.stiffness,
            t.tendon.relaxation_time_s,
            t.tendon.damping_N_s_per_m,
            t.tendon.mass_kg,
            t.friction.viscous_N_s_per_m,
            t.friction.soft_bristle_stiffness_N_per_m * self.bristle,
            t.friction.adhesion_N,
            t.actuator.mass_kg,
            t.actuator.damping_N_s_per_m,
            t.load.mass_kg,
            t.load.damping_N_s_per_m,
            t.load.stiffness_N_per_m * self.load,
            start,
            t.friction.mu_dynamic * self.mu,
            t.friction.release_dynamic * self.mu * self.release,
            t.path.total_angle_rad,
            self.gear_N,
            self.load_exponent,
            start if self.reference_tension_N is None else self.reference_tension_N,
        )
        _library().rig_start(ctypes.byref(self._rig), ctypes.c_double(start))

    def copy(self) -> "Rig":
        """Another in the same state."""
        other = copy.copy(self)
        other._rig = _Rig.from_buffer_copy(self._rig)
        return other

    def set(self, *, mu: float, load: float) -> None:
        """Change friction and load stiffness in mid-run; the load's spring keeps its anchor at the start."""
        t = self.transmission
        self._rig.mu_pull, self._rig.mu_release = t.friction.mu_dynamic * mu, t.friction.release_dynamic * mu
        self._rig.kl = t.load.stiffness_N_per_m * load

    def set_release(self, factor: float) -> None:
        """Change the friction of the releasing direction alone, as a factor on the scenario's."""
        self._rig.mu_release = self.transmission.friction.release_dynamic * factor

    def lubricate(self, first: float, last: float, factor: float) -> None:
        """Another friction on a stretch of the path, from the actuator, as shares of its angle."""
        for k in range(self.masses):
            if first <= (k + 0.5) / self.masses < last:
                self._rig.spot[k] = factor

    def stretch(self, longer_m: float) -> None:
        """Make the tendon longer at rest, at once."""
        for k in range(self.masses + 1):
            end = 0.5 if k in (0, self.masses) else 1.0
            part = end * longer_m / self.masses
            self._rig.e[k] -= part
            self._rig.z[k] -= part

    def advance(self, force_from: float, force_to: float, duration_s: float) -> None:
        """The actuator's force goes straight from one value to the other."""
        steps = ctypes.c_int(round(duration_s / self.step_s))
        _library().rig_advance(ctypes.byref(self._rig), ctypes.c_double(force_from), ctypes.c_double(force_to), steps)

    @property
    def tension_N(self) -> float:
        """Output tension."""
        return float(self._rig.tension)

    @property
    def position_m(self) -> float:
        """Actuator's position relative to the start."""
        return float(self._rig.qa)


class Tuner(Protocol):
    """What closes the loop."""

    @property
    def status(self) -> int:
        """Bits of the last step."""
        ...

    def step(self, reference_N: float, measured: float) -> float:
        """Force at the end of the step."""
        ...


def closed_loop(
    rig: Rig,
    tuner: Tuner,
    reference_N: Array,
    measure: Callable[[Rig], float],
    noise: Array,
    *,
    delay: int = 2,
    step_s: float = 1e-3,
    change: Callable[[Rig, float], None] | None = None,
) -> tuple[Array, NDArray[np.int_]]:
    """Output tension and status at 0, h, 2 h ...; the tuner sees what was measured `delay` steps ago."""
    force, past, tension, status = rig.initial_tension_N, [], [rig.initial_tension_N], [0]
    for k, wanted in enumerate(reference_N[1:]):
        if change is not None:
            change(rig, k * step_s)
        past.append(measure(rig) + noise[k])
        new = tuner.step(float(wanted), float(past[max(0, k - delay)]))
        rig.advance(force, new, step_s)
        force = new
        tension.append(rig.tension_N)
        status.append(int(tuner.status))
    return np.array(tension), np.array(status)
