"""Which modules an export has, by the judgement of each."""

import pytest

from tendonff.compensator.compensators.base import CModule
from tendonff.compensator.export.judgement import Judged, chosen
from tendonff.compensator.export.modules import ADAPTIVE, PLANT
from tendonff.compensator.scenario.unit import NEWTON
from tendonff.ocp.errors import SolveError

WORSE = "RMS error 30 % of range, worse than the reference applied directly (20 %)"
JUDGED = (Judged(module="inverse", score=None, fault=WORSE, unit=NEWTON),)
INVERSE, CAPSTAN = CModule(name="inverse", content="exact"), CModule(name="capstan", content="closed form")


def test_the_tuner_of_an_inverse_that_does_harm_is_not_exported_unless_forced():
    """The tuner was not judged by itself: it starts as the inverse that it tunes."""
    modules, left = chosen(JUDGED, (INVERSE, CAPSTAN, ADAPTIVE, PLANT), force_export=False)
    assert modules == (CAPSTAN, PLANT)
    assert any(text.startswith(f"{ADAPTIVE.name} is not exported: {WORSE}; --force-export") for text in left)
    with pytest.raises(SolveError, match=f"nothing to export: .*{ADAPTIVE.name}: RMS error 30 %"):
        chosen(JUDGED, (ADAPTIVE, PLANT), force_export=False)
    modules, said = chosen(JUDGED, (ADAPTIVE,), force_export=True)
    assert modules == (ADAPTIVE,)
    assert f"{ADAPTIVE.name}: {WORSE}; exported because of --force-export" in said
