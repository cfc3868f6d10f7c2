"""What to expect on a rig: the error of every profile over what is not known of the parameters."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.base import FloatArray, Problem
from tendonff.compensator.compensators.score import scale_N
from tendonff.compensator.compensators.uncertain import Doubt, doubt
from tendonff.compensator.design.robustness import Robustness
from tendonff.models.chain import Chain
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.ocp.simulate import simulate
from tendonff.ocp.tracking.robust import Sample, error_band

_TIE = 1.02  # worst errors that differ by less are equal: then the error with the nominal parameters decides


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """Errors over the samples of the parameters, and the profile that does best there."""

    doubt: Doubt  # what may be the real transmission
    # largest RMS error over the samples, by name of the compensator [% of the reference's range]
    worst_percent: dict[str, float]
    # name of the compensator whose worst error is least, and of equal ones the best with the nominal parameters
    recommended: str
    # low_N, high_N: shape (n,); least and largest output tension over the samples under the recommended profile [N]
    low_N: FloatArray
    high_N: FloatArray


def expect(
    problem: Problem, uncertainty: Uncertainty, forces_N: Mapping[str, FloatArray], found: Robustness | None
) -> Expectation:
    """Try every profile on the samples that the scenario's uncertainty admits, or on those that are assumed.

    Parameters
    ----------
    uncertainty : Uncertainty
        The scenario's.
    forces_N : mapping of str to ndarray, shape (n,)
        By name of the compensator; those that may be used.
    found : Robustness or None
        The bands over the scenario's own samples, where it has any.
    """
    reference, level = problem.reference, problem.level
    start, span = reference.initial_tension_N, scale_N(reference.tension_N)
    real = doubt(problem.transmission, uncertainty)
    bands = (
        found.bands
        if found is not None
        else {
            name: error_band(
                real.samples,
                level,
                force,
                reference.tension_N,
                reference.step_s,
                initial_tension_N=start,
                periodic=reference.periodic,
            )
            for name, force in forces_N.items()
        }
    )
    least = min(bands[name].worst_rms_N for name in forces_N)
    equal = [name for name in forces_N if bands[name].worst_rms_N <= _TIE * least]
    recommended = min(equal or forces_N, key=lambda name: bands[name].nominal_rms_N)
    outputs = _outputs(problem, real.samples, forces_N[recommended])
    return Expectation(
        doubt=real,
        worst_percent={name: 100 * bands[name].worst_rms_N / span for name in forces_N},
        recommended=recommended,
        low_N=np.min(outputs, axis=0),
        high_N=np.max(outputs, axis=0),
    )


def _outputs(problem: Problem, samples: tuple[Sample, ...], force_N: FloatArray) -> FloatArray:
    """Output tension of every sample under a force, shape (samples, n) [N]; what failed stays at its last value."""
    reference, rows = problem.reference, []
    for sample in samples:
        chain = Chain.of(sample.transmission, problem.level)
        run = simulate(chain, force_N, reference.step_s, initial_tension_N=reference.initial_tension_N)
        output = run.output_tension_N
        rows.append(np.pad(output, (0, len(force_N) - len(output)), mode="edge"))
    return np.array(rows)
