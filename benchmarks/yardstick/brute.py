"""Brute force: a tendon cut into many pieces, its balance of forces solved at each row, in numpy alone.

Each piece of contact either sticks or slips at its limit (Coulomb), or drags a bristle (Dahl). No masses, no time: a
row follows from the row before. A bend that straightens loses its contact piece after piece from its far side.
"""

from collections.abc import Callable

import numpy as np

from benchmarks.yardstick.case import Array, Case

Law = Callable[[Array, Array, Array], tuple[Array, Array, Array, Array]]
"""Slips, differences and sums of the tensions at each piece -> residual, and its slopes over the three."""
PIECES = 50
MOST_TURNS, CLOSE_N, STICK, CORNER = 200, 1e-4, 5.0, 8
ROUNDING_N = 1e-9


class Pieces:
    """Contacts in the middle of equal pieces, and links between them; the near end is given its tension."""

    def __init__(self, case: Case) -> None:
        self.case, self.p = case, case.raw.get("adhesion_N", 0.0)
        joint = case.raw.get("joint", {}).get("values", [0.0])
        largest = [s.angle_rad + s.angle_per_rad * (max(joint) if s.joint else 0.0) for s in case.path]
        self.count = [max(round(PIECES * angle / sum(largest)), 1) if angle > 0 else 0 for angle in largest]
        self.size = [angle / max(n, 1) for angle, n in zip(largest, self.count, strict=True)]
        mu = [(s.mu, s.mu if s.mu_release is None else s.mu_release) for s in case.path]
        self.mu = np.repeat(np.array(mu), self.count, axis=0)
        self.whole = sum(s.length_m for s in case.path)
        self.k, self.spring = case.raw["stiffness_N_per_m"], case.raw["far_spring_N_per_m"]

    def at(self, q: float) -> tuple[Array, Array]:
        """Wrap angle of each piece, and distances between neighbours, both ends included."""
        angles, gaps = [], [0.0]
        for section, n, size in zip(self.case.path, self.count, self.size, strict=True):
            turned = q if section.joint else 0.0
            length = section.length_m + section.length_per_rad_m * turned
            angle = section.angle_rad + section.angle_per_rad * turned
            angles.append(np.clip(angle - size * np.arange(n), 0.0, size))
            if n == 0:
                gaps[-1] += length
                continue
            gaps[-1] += length / (2 * n)
            gaps += [length / n] * (n - 1) + [length / (2 * n)]
        return np.concatenate(angles), np.array(gaps)

    def run(self, law_of: Callable[[Array, Array], Law]) -> dict[str, Array]:
        """Outputs at the rows; `law_of` gives the law of a row from its angles and the friction of the row before."""
        case = self.case
        near = case.drive("near", "tension_N")
        joint = case.course("joint") if "joint" in case.raw else np.zeros(len(near))
        u, far, gaps0 = np.zeros(len(self.mu)), [], self.at(joint[0])[1]
        rest = case.raw["start_N"] / self.k * gaps0 / self.whole  # elongations at the start
        tension = np.full(len(self.mu) + 1, float(case.raw["start_N"]))
        for now, q in zip(near, joint, strict=True):
            angles, gaps = self.at(q)
            law = law_of(angles, -np.diff(tension))
            u, tension = self.balance(u, now, self.k * self.whole / gaps, rest + gaps - gaps0, law)
            far.append(tension[-1])
        return {"far_tension_N": np.array(far)}

    def balance(self, u: Array, near: float, stiff: Array, stretch: Array, law: Law) -> tuple[Array, Array]:
        """Displacements and tensions that obey the law: Newton's method with shortened steps, from the old ones."""
        n, old, size = len(u), u, np.inf
        serial = stiff[-1] * self.spring / (stiff[-1] + self.spring)  # last link and spring of the far end
        slope, inner = np.zeros((n + 1, n)), np.arange(1, n)  # of the tensions over the displacements
        slope[inner, inner - 1], slope[inner, inner], slope[n, n - 1] = stiff[1:-1], -stiff[1:-1], serial

        def misses(u: Array) -> tuple[Array, tuple[Array, Array, Array, Array]]:
            pull = stiff[1:-1] * (stretch[1:-1] + u[:-1] - u[1:])
            end = serial * (stretch[-1] + self.case.raw["start_N"] / self.spring + u[-1])
            tension = np.maximum(np.concatenate([[near], pull, [end]]), 0.0)
            return tension, law(u - old, -np.diff(tension), tension[:-1] + tension[1:])

        tension, (residual, by_slip, by_difference, by_sum) = misses(u)
        for _ in range(MOST_TURNS):
            size = float(np.linalg.norm(residual))
            if size < CLOSE_N:
                return u, tension
            taut = slope * (tension > 0)[:, None]
            jacobian = by_difference[:, None] * (taut[:-1] - taut[1:]) + by_sum[:, None] * (taut[:-1] + taut[1:])
            jacobian[np.arange(n), np.arange(n)] += by_slip
            step, share = np.linalg.solve(jacobian, residual), 1.0
            while np.linalg.norm(misses(u - share * step)[1][0]) > (1 - 1e-4 * share) * size and share > 1e-4:
                share /= 2
            u = u - share * step
            tension, (residual, by_slip, by_difference, by_sum) = misses(u)
        raise RuntimeError(f"no balance found: {size:.3g} N is left after {MOST_TURNS} turns")


def coulomb_run(case: Case) -> dict[str, Array]:
    """Coulomb friction at every piece, up to tanh(mu phi/2) of the sum of its tensions.

    A contact gives way first, by a tenth of what a link would; the corner to slip is rounded, or no method finds a
    balance in which many pieces change at once.
    """
    pieces = Pieces(case)
    stiff = STICK * pieces.k * len(pieces.mu)

    def law_of(angles: Array, before: Array) -> Law:
        pull, release = np.maximum(np.tanh(pieces.mu.T * angles / 2), 1e-9)

        def law(slip: Array, difference: Array, both: Array) -> tuple[Array, Array, Array, Array]:
            trial = before + stiff * slip
            limit = np.where(trial >= 0, pull, -release)
            x = trial / (limit * (both + 2 * pieces.p))
            friction = trial * (1 + x**CORNER) ** (-1 / CORNER)
            share = (1 + x**CORNER) ** (-1 / CORNER - 1)
            return difference - friction, -stiff * share, np.ones_like(slip), -limit * x ** (CORNER + 1) * share

        return law

    return pieces.run(law_of)


def presliding_run(case: Case) -> dict[str, Array]:
    """A Dahl bristle at every piece: friction nears its limit F as e^(-sigma x/F) over the slip x of a row."""
    pieces = Pieces(case)
    sigma = case.raw["bristle_N_per_m"] / len(pieces.mu)

    def law_of(angles: Array, before: Array) -> Law:
        pull, release = np.tanh(pieces.mu.T * angles / 2)

        def law(slip: Array, difference: Array, both: Array) -> tuple[Array, Array, Array, Array]:
            limit = np.where(slip >= 0, pull, -release)
            top = limit * (both + 2 * pieces.p)
            fade = np.exp(-sigma * slip / top)
            friction = top - (top - before) * fade
            by_top = 1 - fade - (top - before) * fade * sigma * slip / top**2
            return difference - friction, -sigma * (top - before) / top * fade, np.ones_like(slip), -by_top * limit

        return law

    return pieces.run(law_of)


class LedContacts:
    """Equal contacts between two led ends: each sticks, or slips at its limit. Exact: an active set."""

    def __init__(self, exponent: float, count: int) -> None:
        self.ratio, self.slip, self.way = np.exp(exponent / count), np.zeros(count), np.zeros(count, int)
        self.before: Array | None = None

    def balance(self, unslipped: Array, stiff: Array) -> Array:
        """Tension of each span [N], from that without the slip since the start and its stiffness [N/m]."""
        start = self.slip, self.way
        tension = self.turns(unslipped, stiff)
        if tension is None and self.before is not None:  # many contacts turn at once: half the way first
            self.slip, self.way = start
            self.balance((self.before + unslipped) / 2, stiff)
            tension = self.balance(unslipped, stiff)
        elif tension is None:
            raise RuntimeError(f"no balance of {len(self.slip)} contacts found")
        self.before = unslipped
        return tension

    def turns(self, unslipped: Array, stiff: Array) -> Array | None:
        """Tensions once no contact changes any more; None if they never stop."""
        n = len(self.slip)
        slope, at = np.zeros((n + 1, n)), np.arange(n)  # of the tensions over the slip
        slope[at, at], slope[at + 1, at] = -stiff[:-1], stiff[1:]
        for _ in range(2 * n):
            matrix, wanted = np.eye(n), self.slip.copy()
            for way in (1, -1):
                slips = self.way == way
                matrix[slips], wanted[slips] = self.over(slope, way)[slips], -self.over(unslipped, way)[slips]
            slip = np.linalg.solve(matrix, wanted)
            tension: Array = unslipped + slope @ slip
            goes_on = np.where(self.way * (slip - self.slip) > 0, self.way, 0)
            begins = sum(way * (self.over(tension, way) > ROUNDING_N) for way in (1, -1))
            before, self.way = self.way, np.where(self.way == 0, begins, goes_on)
            if (self.way == before).all():
                self.slip = slip
                return tension
        return None

    def over(self, tension: Array, way: int) -> Array:
        """Tension beyond the limit of each contact, towards the near end (1) or the far one (-1); or its slope."""
        high, low = (tension[:-1], tension[1:])[::way]
        excess: Array = high - self.ratio * low
        return excess


def relaxing_run(case: Case) -> dict[str, Array]:
    """A visco-elastic tendon (Zener) whose ends are held, or led, by springs: what a spring lets go slips back."""
    raw, start = case.raw, case.raw["start_N"]
    share = np.r_[0.5, np.ones(PIECES - 1), 0.5] / PIECES
    lasting, relaxing = (raw[f"{name}stiffness_N_per_m"] / share for name in ("", "relaxing_"))
    turn = raw["row_s"] / raw["relaxation_time_s"] / 2  # of the relaxing part in a row, by the trapezoidal rule
    stiff = lasting + relaxing / (1 + turn)
    given = np.r_[1 / raw["hold_N_per_m"], np.zeros(PIECES - 1), 1 / raw["hold_N_per_m"]]  # compliance of the ends
    near, far = (np.nan_to_num(case.drive(end, "travel_m")) for end in ("near", "far"))
    contacts, first = LedContacts(sum(s.exponents[0] for s in case.path), PIECES), start / lasting
    elongation, relaxed, rows = first, first, []
    for led in zip(near, -far, strict=True):
        past = -relaxing * ((1 - turn) * relaxed + turn * elongation) / (1 + turn)
        free = first + start * given
        free[[0, -1]] += led
        tension = contacts.balance((stiff * free + past) / (1 + stiff * given), stiff / (1 + stiff * given))
        before, elongation = elongation, (tension - past) / stiff
        relaxed = ((1 - turn) * relaxed + turn * (before + elongation)) / (1 + turn)
        rows.append(tension)
    found = np.array(rows)
    return {"near_tension_N": found[:, 0], "far_tension_N": found[:, -1]}
