"""CasADi's own folding against `ocp.codegen.partial_evaluation`: `python -m benchmarks.folding`.

Of the laws of single tendons, with the numbers of examples and the weight of the scheme put in: how often CasADi's
`substitute` gives other bits than the law as it is written, and what either leaves to be computed.
"""

from pathlib import Path

import casadi as ca
import numpy as np

import tendonff as tf
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step.folding import chain_evaluator, scheme_rows
from tendonff.ocp.step.laws import ElementLaws

EXAMPLES = Path(__file__).parent.parent / "examples"
NAMES = "bowden", "finger", "finger_stribeck", "surgical"
SAMPLES = 2000


def operations(function):
    """Of a function, without inputs, outputs and constants."""
    free = ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST
    return sum(function.instruction_id(k) not in free for k in range(function.n_instructions()))


def measured(law, folder, rng):
    """Share of random arguments with other bits, largest relative difference, operations of CasADi, statements of C."""
    known = {name: values[1] for name, values in folder.parameters.items()}  # of the usual step
    every, outputs = ca.vertcat(*law.inputs), ca.vertcat(*law.outputs.values())
    put_in = [s for s in law.inputs if s.name() in known]
    left = [s for s in law.inputs if s.name() not in known]
    numbers = ca.DM([known[s.name()] for s in put_in])
    folded = ca.substitute([outputs], [ca.vertcat(*put_in)], [numbers])[0] if put_in else outputs
    given = rng.standard_normal((SAMPLES, len(law.inputs))) * 10.0 ** rng.integers(-4, 3, (SAMPLES, len(law.inputs)))
    for k, symbol in enumerate(law.inputs):
        given[:, k] = known.get(symbol.name(), given[:, k])
    of_left = [k for k, symbol in enumerate(law.inputs) if symbol.name() not in known]
    function = ca.Function("folded", [ca.vertcat(*left)], [folded])
    written = np.asarray(ca.Function("written", [every], [outputs])(given.T))
    found = np.asarray(function(given[:, of_left].T)) if left else np.tile(np.asarray(function(0)), (1, SAMPLES))
    unlike = ~((found == written) | (np.isnan(found) & np.isnan(written)))
    with np.errstate(all="ignore"):
        apart = np.where(unlike, np.abs(found - written) / np.maximum(np.abs(written), 1e-300), 0.0)
    statements = folder.fold(law).code.count(" = ") - len(law.outputs)
    return unlike.any(axis=0).mean(), float(np.nanmax(apart)), operations(function), statements


def main():
    """Print the table."""
    rng, rows = np.random.default_rng(0), []
    for name in NAMES:
        scenario = tf.load_scenario(EXAMPLES / f"{name}.toml")
        for level in tf.Level:
            chain = Chain.of(scenario.transmission, level)
            laws = ElementLaws.of(chain)
            folder = chain_evaluator(chain, scheme_rows(scenario.run.step_s), "t", Precision.DOUBLE)
            for law in (*laws.inverse(), *laws.simulation()):
                rows.append(measured(law, folder, rng))
                print(f"{name:16s} {level:13s} {law.name:18s} other bits {100 * rows[-1][0]:5.1f} %", end=" ")
                print(f"by {rows[-1][1]:.1e}, operations {rows[-1][2]:3d}, statements of C {rows[-1][3]:3d}")
    shares, apart, operated, stated = np.array(rows).T
    print(f"{(shares > 0).sum()} of {len(rows)} laws have other bits, by {apart.max():.1e} at most;", end=" ")
    print(f"{operated.sum():.0f} operations, {stated.sum():.0f} statements")


if __name__ == "__main__":
    main()
