"""The comparison of the golden set sees changes of results, and nothing in what another processor rounds otherwise."""

import json

import golden_set
import numpy as np
import pytest

FORM, FULL = golden_set.Form(), golden_set.Form(exact=True)
TIME_S = np.linspace(0.0, 4.0, 4001)
FORCE_N = 40.0 + 20.0 * np.sin(3.0 * TIME_S)


def table(**columns):
    rows = (",".join(repr(float(v)) for v in row) for row in zip(*columns.values(), strict=True))
    return ",".join(columns) + "\n" + "\n".join(rows) + "\n"


def found(name, old, new, share=golden_set.TOLERANCE, **how):
    return golden_set.compared(name, old, new, lambda _: share, **how)


def of_tables(old, new, form=FORM, **how):
    return found("t.csv", form.table(table(**old)), form.table(table(**new)), **how)


def rounded_elsewhere(values, share=1e-10):
    """As another processor might: noise of a share of the largest magnitude."""
    return values + share * np.abs(values).max() * np.random.default_rng(3).uniform(-1, 1, len(values))


def test_a_table_rounded_elsewhere_is_the_same():
    assert of_tables({"force_N": FORCE_N}, {"force_N": rounded_elsewhere(FORCE_N)}) == []


def test_what_is_far_below_the_scale_of_its_quantity_may_be_anything():
    noise = np.random.default_rng(4).normal(size=(2, 100))
    assert of_tables({"error_N": 1e-9 * noise[0]}, {"error_N": 1e-9 * noise[1]}) == []
    assert of_tables({"error_N": 1e-5 * noise[0]}, {"error_N": 1e-5 * noise[1]}) != []


@pytest.mark.parametrize(
    "defect",
    [
        pytest.param(-FORCE_N, id="a sign"),
        pytest.param(FORCE_N * (1 + 1e-6), id="a factor of a millionth"),
        pytest.param(np.roll(FORCE_N, 1), id="off by one"),
        pytest.param(np.where(np.arange(4001) == 1777, FORCE_N + 0.1, FORCE_N), id="one row between the stored ones"),
        pytest.param(FORCE_N[:-1], id="a row less"),
    ],
)
def test_a_defect_in_a_column_is_seen(defect):
    assert of_tables({"force_N": FORCE_N}, {"force_N": defect}) != []


def test_the_exact_mode_sees_every_row_and_the_twelfth_digit():
    moved = FORCE_N.copy()
    moved[1777] *= 1 + 1e-11
    assert of_tables({"force_N": FORCE_N}, {"force_N": moved}, FULL, share=golden_set.EXACT, exact=True) != []
    assert of_tables({"force_N": FORCE_N}, {"force_N": moved}) == []


def code(values, scalar="0.25", checksum=12345):
    body = ",\n    ".join(map(repr, map(float, values)))
    return (
        f"#define GAIN {scalar}\nstatic const double profile[N] = {{\n    {body}\n}};\n"
        f"static const test_line test_lines[] = {{\n    {{ TEST_SUM, {checksum}u }},\n}};\n"
        f"static const tff_real test_numbers[] = {{\n    /* inverse, golden vectors: answer */\n    {body}\n}};\n"
    )


def of_codes(tmp_path, old, new, **how):
    lines = found("f.c", FORM.code(old), FORM.code(new), **how)
    arrays = []
    for name, text in (("old", old), ("new", new)):
        (tmp_path / name).mkdir(exist_ok=True)
        (tmp_path / name / "f.c").write_text(text)
        arrays.append(FORM.arrays(tmp_path / name))
    return lines + found("arrays.json", *arrays, **how)


def test_exported_arrays_are_numbers_and_the_text_around_them_is_text(tmp_path):
    elsewhere = code(rounded_elsewhere(FORCE_N), checksum=777)
    assert of_codes(tmp_path, code(FORCE_N), elsewhere) == []
    assert of_codes(tmp_path, code(FORCE_N), elsewhere.replace("GAIN", "LOSS")) != []
    assert of_codes(tmp_path, code(FORCE_N), code(np.roll(FORCE_N, 1))) != []
    assert of_codes(tmp_path, code(FORCE_N), code(FORCE_N[:-1])) != []
    assert of_codes(tmp_path, code(FORCE_N), code(FORCE_N, scalar="0.26")) != []
    assert "static const double profile[N] = {" in FORM.code(code(FORCE_N))
    shifted = code(FORCE_N).replace("answer */\n    ", "answer */\n    1.0 + ")
    assert of_codes(tmp_path, code(FORCE_N), shifted) != []
    assert FULL.code(code(FORCE_N)) == code(FORCE_N)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("an error of 24.5 % of 32.98 N", "an error of 24.6 % of 32.98 N"),  # 24.55 rounds either way
        ("T = 1.8744560875853382", "T = 1.8744560875853391"),
        ("\u22120.4204867346171355 dB", "\u22120.4204867346158778 dB"),
    ],
)
def test_numbers_in_a_text_may_round_to_the_next(old, new):
    assert golden_set.same_text(old, new, golden_set.TOLERANCE)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("an error of 24.5 %", "an error of 24.7 %"),
        ("a loss of 24.5 %", "an error of 24.5 %"),
        ("4 of 10 reversals", "5 of 10 reversals"),
        ("mu = 0.2", "mu = 0.3"),
        ("from -1.25 N", "from 1.25 N"),
        ("tension_1", "tension_2"),
        ("T = 1.8744560875853382", "T = 1.8744561875853382"),
        ("0x1F 1.25", "0x2F 1.25"),
    ],
)
def test_other_differences_of_a_text_are_seen(old, new):
    assert not golden_set.same_text(old, new, golden_set.TOLERANCE)


def of_data(old, new, **how):
    return found("d.json", FORM.data(old), FORM.data(new), **how)


def test_data_is_compared_by_the_scale_under_its_key():
    old = {"inverse": {"rmse_N": 1e-9}, "none": {"rmse_N": 8.0}, "status": "exact", "count": 3}
    assert of_data(old, {**old, "inverse": {"rmse_N": 3e-9}}) == []
    assert of_data(old, {**old, "none": {"rmse_N": 8.0001}}) != []
    assert of_data(old, {**old, "status": "limited"}) != []
    assert of_data(old, {**old, "count": 4}) != []
    assert of_data(old, {k: v for k, v in old.items() if k != "count"}) != []
    assert of_data({"mu": 0.2, "stiffness_N_per_m": 2e4}, {"mu": 0.21, "stiffness_N_per_m": 2e4}, alone=True) != []
    assert of_data({"values_N": FORCE_N.tolist()}, {"values_N": np.roll(FORCE_N, 1).tolist()}) != []


def test_clock_version_and_iterations_are_left_out():
    old = {"tool": "1", "solve_s": 1.0, "iterations": 57, "message": "57 iterations, 3.1 s", "rmse_N": 0.1}
    new = {"tool": "2", "solve_s": 2.0, "iterations": 58, "message": "58 iterations, 2.9 s", "rmse_N": 0.1}
    assert of_data(old, new) == []
    assert set(json.loads(FORM.data(old))) == {"message", "rmse_N"}
