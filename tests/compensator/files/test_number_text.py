import numpy as np
import pytest

from tendonff.compensator.files.writing import BYTES_MORE, BYTES_PER_NUMBER, Writer, compiled_writer


@pytest.fixture(scope="module")
def writer() -> Writer:
    found = compiled_writer()
    if found is None:
        pytest.skip("no C compiler with integers of 128 bits")
    return found


def text_of(writer: Writer, block: np.ndarray) -> str:
    out = np.zeros(BYTES_PER_NUMBER * block.size + BYTES_MORE, dtype=np.uint8)
    return out[: writer(np.ascontiguousarray(block), out)].tobytes().decode()


def cells(writer: Writer, values: np.ndarray) -> list[str]:
    return text_of(writer, values[:, None]).splitlines()


def numbers() -> np.ndarray:
    """Every size, decimals that people write, and the neighbours of powers of two and ten."""
    rng = np.random.default_rng(11)
    powers = np.concatenate([2.0 ** np.arange(-18, 32), 10.0 ** np.arange(-6, 11)])
    values = np.concatenate(
        [
            10 ** rng.uniform(-5, 9, 40_000),
            10 ** rng.uniform(-300, 300, 2_000),
            np.arange(20_000) * 1e-3,
            np.round(rng.uniform(0, 200, 20_000), 3),
            rng.integers(1, 10**10, 5_000).astype(np.float64),
            powers,
            np.nextafter(powers, 0.0),
            np.nextafter(powers, np.inf),
            [0.1, 0.3, 1 / 3, 0.1 + 0.2, 999_999_999.999_999_9, 5e-324, 1.7e308],
        ]
    )
    return np.concatenate([values, -values, [0.0, -0.0]])


def test_every_number_reads_back_as_the_same_double(writer: Writer) -> None:
    values = numbers()
    found = np.array([float(cell) for cell in cells(writer, values)])
    assert np.array_equal(found, values)
    assert np.array_equal(np.signbit(found), np.signbit(values))


def test_the_text_is_as_short_as_any_that_reads_back(writer: Writer) -> None:
    values = numbers()
    values = values[(np.abs(values) >= 1e-4) & (np.abs(values) < 1e9)]
    assert [len(cell) for cell in cells(writer, values)] == [len(repr(float(value))) for value in values]


def test_rows_are_lines_and_columns_are_separated_by_commas(writer: Writer) -> None:
    block = np.array([[0.0, 30.0, -1.25], [1e-3, np.nan, -np.inf]])
    assert text_of(writer, block) == "0.0,30.0,-1.25\n0.001,nan,-inf\n"


def test_a_buffer_that_is_too_small_is_refused(writer: Writer) -> None:
    with pytest.raises(ValueError, match="the buffer holds 100 bytes, too few for 10 numbers"):
        writer(np.zeros((5, 2)), np.zeros(100, dtype=np.uint8))
