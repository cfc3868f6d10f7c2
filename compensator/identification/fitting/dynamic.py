"""Stage (c): the whole chain against the measurement, from coarse to fine, and which of its laws the data supports."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.chain_law import (
    ChosenLaw,
    choose_law,
    fit_free,
)
from tendonff.compensator.identification.fitting.errors import Prediction
from tendonff.compensator.identification.fitting.noisy_input import residuals_of
from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain, put_into
from tendonff.compensator.identification.fitting.residuals import ChainResiduals, FitPiece, fit_pieces, spans_of
from tendonff.compensator.identification.fitting.second_look import look_again
from tendonff.compensator.identification.fitting.uncertainty import (
    ByFile,
    doubt_of_other_laws,
    expected_errors,
    file_estimates,
    slopes_over_all,
    with_common_errors,
    with_floors,
    with_scatter,
    with_taken_for_granted,
)
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Record, mean_pose
from tendonff.compensator.identification.measured.gains import EXACT_GAINS, Gains
from tendonff.compensator.identification.measured.smoothing import low_pass_piece
from tendonff.compensator.identification.pace import UNHURRIED, Pace
from tendonff.compensator.identification.parameters import BY_TENSIONS, CONSTANTS, CORE, SPEED_TERMS, TENDON, Parameter
from tendonff.compensator.scenario.measurement import Explain
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.fits.chain import Drive
from tendonff.ocp.fits.least_squares import Residuals, Solution

D = Parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainLaw:
    """A chain with its values."""

    model: ParametricChain
    values: Mapping[Parameter, float]  # all of them; what was not free has the value it was given
    explain: Explain  # OUTPUT or POSITION

    def predicted(self, record: Record) -> list[Prediction]:
        """Prediction of every piece of a record, low-passed as what was measured; SolveError if a simulation fails."""
        found = []
        for number, run in enumerate(fit_pieces([record], self.explain)):
            after_gap = number > 0 and self.explain is Explain.OUTPUT
            drives = self._after_gap(run) if after_gap else (run.drive,)
            found.append(min((self._predicted(run, drive) for drive in drives), key=partial(_left_in, run)))
        return found

    def _predicted(self, run: FitPiece, drive: Drive) -> Prediction:
        response = self.model.predict(self.values, drive)
        channels = (run.predicted(response)[0], response.elongation_m)
        explained, elongation = (low_pass_piece(x, run.record.step_s, run.record.cutoff_Hz) for x in channels)
        return Prediction(explained=explained, elongation_m=elongation if run.with_elongation else None)

    def _after_gap(self, run: FitPiece) -> tuple[Drive, ...]:
        """Ways to the first sample of a piece behind a gap: from rest, and from a stroke in which the tendon slid."""
        law = CapstanLaw.of(put_into(self.model.transmission, self.model, self.values), mean_pose([run.record]))
        turns = [float(law.input_for_N(run.drive.first_output_N, branch)) for branch in Branch]
        return run.drive, *(replace(run.drive, turned_N=max(turn, 0.0)) for turn in turns)


def _left_in(run: FitPiece, found: Prediction) -> float:
    """Squared error of a prediction for a piece."""
    return float(np.sum((found.explained - run.measured)[run.piece.good] ** 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class DynamicFit(ChainLaw):
    """The chain, fitted, with the scenario's own number of masses: its errors are those of the answer that goes on."""

    solution: Solution  # of the free ones, with the input's noise and doubt about the law in its covariance
    noise: Array  # its correlation without the doubt about the law: the diagonal is the share of noise
    # standard error that each parameter would have if it were free as well; infinite where the data is blind
    expected: dict[Parameter, float]
    law: ChosenLaw  # with the laws that were compared
    mean_N: float  # mean output tension
    files: tuple[ByFile, ...]  # what each file says by itself; empty for a single file
    # by how much more of the wrap angle the nearer half of the path seems to carry than half [-]; 0: even
    concentration: float = 0.0
    caution: str = ""  # what could not be done about the input's noise, and what that means; empty where it was
    other: Mapping[Parameter, float] | None = None  # all values of another law that the data do not exclude
    bounded: frozenset[Parameter] = frozenset()  # at the least value that the data allow, without an upper limit

    def with_other_friction(self, transmission: Transmission) -> Transmission | None:
        """The transmission by the other law that the data do not exclude; None without one."""
        return None if self.other is None else put_into(transmission, self.model, self.other)


def _tension_N(pieces: Sequence[FitPiece]) -> Array:
    """The tension that the law's constants are compared with, over all pieces, shape (rows,)."""
    proximal = pieces[0].explain is Explain.POSITION
    return np.concatenate([run.piece.input_N if proximal else run.piece.output_N for run in pieces])


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseFit:
    """A first fit on few masses: where the other stages start, and whether the chain describes the data at all."""

    task: ChainResiduals
    solution: Solution
    percent: float  # robust error of the output in percent of its range


def fit_coarse(
    records: Sequence[Record],
    transmission: Transmission,
    start: Mapping[Parameter, float],
    explain: Explain = Explain.OUTPUT,
    *,
    several: bool = True,
    pace: Pace = UNHURRIED,
) -> CoarseFit:
    """Fit friction and presliding, and the tendon where positions exist, from what is known.

    With `several` it starts from several stiffnesses of the bristle and, where nothing was measured at the far end
    (POSITION is explained), from several mu. `pace` bounds this fit and those that go on from it.
    """
    pieces = fit_pieces([r.decimated(TUNED.coarse_step_s) for r in records], explain)
    span, span_m = spans_of(pieces)
    span_N = max(float(np.ptp(_tension_N(pieces))), 1e-12)
    model = ParametricChain(
        transmission=transmission,
        level=Level.PRESLIDING,
        count=TUNED.coarse_masses,
        longest_step_s=TUNED.coarse_step_s,
        keep_pace=pace.keep,
    )
    known = {**model.values(), **{n: v for n, v in start.items() if n not in CONSTANTS and n not in SPEED_TERMS}}
    proximal = explain is Explain.POSITION
    seconds = sum(float(np.ptp(r.piece.time_s)) for r in pieces)
    task = ChainResiduals(
        model=model,
        pieces=pieces,
        fixed=known,
        free=CORE + (TENDON if proximal or all(r.with_elongation for r in pieces) else ()),
        output_unit=TUNED.robust_share * span,
        elongation_unit_m=TUNED.robust_share * span_m,
        block_s=min(seconds / TUNED.blocks, TUNED.longest_block_s),
    )
    starts = [
        {
            **known,
            D.BRISTLE: factor * known[D.BRISTLE],
            D.MU: share * known[D.MU],
            D.MU_RELEASE: share * known[D.MU_RELEASE],
        }
        for factor in (TUNED.bristle_starts if several else (1.0,))
        for share in (TUNED.mu_starts if proximal and several else (1.0,))
    ]
    first = min((fit_free(task, at, span_N, 5, 1e-3) for at in starts), key=lambda s: s.cost)
    solution = fit_free(task, task.complete(first.values), span_N, 10, 1e-3)
    percent = 100 * task.error_of(solution.residuals).robust_rms / span
    return CoarseFit(task=task, solution=solution, percent=percent)


def fit_dynamic(
    coarse: CoarseFit,
    records: Sequence[Record],
    start: Mapping[Parameter, float],
    *,
    validation: Sequence[Record] = (),
    biases: bool = False,
    offsets: bool = False,
    gains: Gains = EXACT_GAINS,
    kept_uncertainty: float = 0.0,
    begin: Callable[[str], None] = UNHURRIED.begin,
) -> DynamicFit:
    """Choose the law on few masses and thinned samples, then move its values to those of many masses and all samples.

    The files of `validation` judge the laws, or without them parts of the fitted ones in turn. With `biases` the input
    cell's bias may be free, with `offsets` the output cell may have an offset that the files tell. The uncertainty of
    kept values is that of [measurement].
    """
    task = coarse.task.continued(coarse.solution)
    transmission, explain, tension = task.model.transmission, task.pieces[0].explain, _tension_N(task.pieces)
    span_N, mean_N = max(float(np.ptp(tension)), 1e-12), float(np.mean(tension))
    begin("dynamic stage: choice of the law")
    judges = fit_pieces([r.decimated(TUNED.coarse_step_s) for r in validation], explain)
    law = choose_law(task, judges, start, span_N, mean_N, biases=biases)
    search, solution, bounded = with_lower_bound(law.task.continued(law.solution), law.solution, span_N)
    begin("dynamic stage: fine chain, noise on the input")
    fine = replace(
        search.model, count=max(TUNED.fine_masses, transmission.path.segments), longest_step_s=TUNED.fine_step_s
    )
    task = replace(search, model=fine, pieces=fit_pieces(records, explain))
    solution = replace(solution, residuals=residuals_of(task, solution.values))

    def seen(task: ChainResiduals, solution: Solution) -> tuple[ChainResiduals, Residuals, tuple[Parameter, ...]]:
        """The task on few masses at a solution, residuals with slopes over all values, and their names."""
        model = replace(search.model, symmetric=task.model.symmetric)
        quick = replace(task, model=model, pieces=search.pieces, fixed=task.complete(solution.values))
        every = (*task.free, *(n for n in BY_TENSIONS if n not in task.free and n is not D.LOAD_EXPONENT))
        return quick, slopes_over_all(quick, every), every

    def with_granted(task: ChainResiduals, solution: Solution) -> Solution:
        quick, slopes, every = seen(task, solution)
        return with_taken_for_granted(solution, slopes, every, quick, gains=gains, kept_uncertainty=kept_uncertainty)

    again = look_again(law, task, solution, span_N, offsets=offsets, with_granted=with_granted)
    task, solution = again.task, again.solution
    begin("dynamic stage: uncertainty")
    quick, slopes, every = seen(task, solution)
    files = file_estimates(quick, slopes, solution)
    law_doubt, concentration = doubt_of_other_laws(solution, slopes, every, quick)
    solution = with_floors(with_scatter(with_common_errors(solution), files), mean_N)
    solution = with_taken_for_granted(solution, slopes, every, quick, gains=gains, kept_uncertainty=kept_uncertainty)
    whole = replace(solution, covariance=solution.covariance + law_doubt)
    return DynamicFit(
        model=replace(task.model, count=transmission.path.segments),
        values=task.complete(solution.values),
        explain=explain,
        solution=whole,
        noise=whole.share(solution.covariance),
        expected=expected_errors(slopes, every),
        law=again.law,
        mean_N=mean_N,
        files=files,
        concentration=concentration,
        caution=again.caution,
        bounded=bounded,
        other=None if again.other is None else again.other[0].complete(again.other[1].values),
    )


def with_lower_bound(
    task: ChainResiduals, solution: Solution, span_N: float
) -> tuple[ChainResiduals, Solution, frozenset[Parameter]]:
    """The bristle at the least stiffness that the data allow, where they set no upper limit; and whether it is there.

    The more compliant of two bristles that explain the data alike is the one whose inverse asks for less.
    """
    size = solution.values.get(D.BRISTLE, 0.0)
    if D.BRISTLE not in task.free or (
        solution.standard_error(D.BRISTLE) < TUNED.identifiable_share * size and D.BRISTLE not in solution.at_bound
    ):
        return task, solution, frozenset()
    at = task.complete(solution.values)
    rows = task.independent_rows(solution.residuals)
    tried = [size * 2.0**k for k in (2, *range(0, -14, -1))]
    errors = [task.error_at({**at, D.BRISTLE: stiffness}).robust_rms for stiffness in tried]
    allowed = [2 * rows * np.log(max(error / min(errors), 1.0)) < TUNED.very_sure for error in errors]
    if not allowed[0]:
        return task, solution, frozenset()
    insensitive = all(allowed)
    least = task.model.values()[D.BRISTLE] if insensitive else tried[max(allowed.index(False) - 1, 1)]
    held = replace(task, free=tuple(n for n in task.free if n is not D.BRISTLE), fixed={**at, D.BRISTLE: least})
    return held, fit_free(held, held.fixed, span_N, 5, 1e-5), frozenset(() if insensitive else (D.BRISTLE,))
