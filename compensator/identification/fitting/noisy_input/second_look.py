"""Constants of the law, judged again once the input is estimated with them.

While noise on the input is taken for friction, whether a rig has load-independent friction cannot be told well, and an
offset of the output cell hides in the two directions' coefficients. With the input estimated their errors are five to
ten times smaller: the law with all of them free is asked, and those that it does not tell are taken out again.
"""

from dataclasses import replace

import numpy as np

from tendonff.compensator.identification.fitting.chain_law import LAW_NAMES, ChainCandidate, ChosenLaw
from tendonff.compensator.identification.fitting.noisy_input.estimation import residuals_of, with_input_estimated
from tendonff.compensator.identification.fitting.residuals import ChainResiduals
from tendonff.compensator.scenario.measurement import Explain
from tendonff.ocp.fits.chain import DynamicParameter
from tendonff.ocp.fits.least_squares import Solution

D = DynamicParameter

SURE_OF_OFFSET, SURE_OF_ADHESION, SURE_OF_DIRECTION = 4.0, 2.0, 4.0
"""Standard errors from nothing, and of one direction's coefficient from the other's, from which on the law has it."""


def look_again(
    law: ChosenLaw, task: ChainResiduals, solution: Solution, *, offsets: bool
) -> tuple[ChosenLaw, ChainResiduals, Solution]:
    """The law with the constants that the data tell, and its values with the input estimated.

    Parameters
    ----------
    task : ChainResiduals
        Of that law, on many masses.
    offsets : bool
        The output cell may have an offset.
    """
    proximal = task.pieces[0].explain is Explain.POSITION
    if D.INPUT_BIAS in task.free or all(run.record.input_noise_N <= 0 for run in task.pieces):
        return law, task, with_input_estimated(task, solution)
    full = task.complete(solution.values)
    offered = [*((D.OUTPUT_BIAS,) if offsets and not proximal else ()), D.ADHESION, D.MU_RELEASE]
    free = (*task.free, *(name for name in offered if name not in task.free))
    wide = replace(task, model=replace(task.model, symmetric=False), free=free)
    at = {str(name): full[name] for name in free}
    told = with_input_estimated(
        wide, replace(solution, values=at, residuals=residuals_of(wide, at)), rounds=1, signed=True
    )
    if len(told.covariance) != len(free):  # the chain failed on the way
        return law, task, solution
    own, dropped = task.model.values(), set[DynamicParameter]()
    for name, sure in ((D.OUTPUT_BIAS, SURE_OF_OFFSET), (D.ADHESION, SURE_OF_ADHESION)):
        if name in free and own[name] == 0:
            size = abs(told.values[name]) if name is D.OUTPUT_BIAS else told.values[name]
            if not size > sure * told.standard_error(name):
                told = _without(told, name)
                dropped.add(name)
    symmetric = task.model.symmetric and _is_symmetric(told)
    if symmetric:
        dropped.add(D.MU_RELEASE)
    kept = tuple(name for name in free if name not in dropped)
    chosen = replace(
        task,
        model=replace(task.model, symmetric=symmetric),
        free=kept,
        fixed={**full, **dict.fromkeys(dropped & {D.OUTPUT_BIAS, D.ADHESION}, 0.0)},
    )
    at = {str(name): float(told.values[name]) for name in kept}
    found = with_input_estimated(chosen, replace(solution, values=at, residuals=residuals_of(chosen, at)))
    if len(found.covariance) != len(kept):
        return law, task, solution
    return _renamed(law, chosen, found), chosen, found


def _without(solution: Solution, name: DynamicParameter) -> Solution:
    """Values and covariance of the others where one of them is nothing."""
    place, covariance = list(solution.values).index(name), solution.covariance
    share, size = covariance[:, place] / covariance[place, place], solution.values[name]
    values = {
        other: value - float(by) * size for (other, value), by in zip(solution.values.items(), share, strict=True)
    }
    return replace(solution, values=values, covariance=covariance - np.outer(share, covariance[place]))


def _is_symmetric(solution: Solution) -> bool:
    """One coefficient does for both directions."""
    pull, release = (list(solution.values).index(name) for name in (D.MU_PULL, D.MU_RELEASE))
    covariance = solution.covariance
    variance = covariance[pull, pull] + covariance[release, release] - 2 * covariance[pull, release]
    apart = abs(solution.values[D.MU_PULL] - solution.values[D.MU_RELEASE])
    return bool(apart < SURE_OF_DIRECTION * np.sqrt(max(variance, 0.0)))


def _renamed(law: ChosenLaw, task: ChainResiduals, solution: Solution) -> ChosenLaw:
    """The chosen law under the name of what it has now, among those that were compared."""
    if set(task.free) == set(law.task.free) and task.model.symmetric == law.task.model.symmetric:
        return law
    name = "symmetric with presliding" if task.model.symmetric else "asymmetric with presliding"
    name += "".join(f", {LAW_NAMES[extra]}" for extra in LAW_NAMES if extra in task.free)
    full = task.complete(solution.values)
    train, judge = (
        replace(part, model=replace(part.model, symmetric=task.model.symmetric)) for part in (law.train, law.judge)
    )
    own = ChainCandidate(
        name=name,
        size=len(task.free),
        fit=train.rms_of_chain(full),
        validation=judge.rms_of_chain(full),
        chosen=True,
    )
    others = [replace(one, chosen=False) for one in law.candidates if one.name != name]
    return replace(law, candidates=(*others, own), judge=judge)
