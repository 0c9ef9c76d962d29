"""A damaged Parquet file is refused; it used to end the process inside Polars."""

import numpy as np
import polars
import pytest

from schuler import InputError
from schuler.io.tables.parquet_file import parquet_frame, parquet_schema


@pytest.fixture(params=["zstd", "uncompressed", "snappy"])
def good(tmp_path, request):
    rng = np.random.default_rng(4)
    columns = {"time_s": np.arange(300) / 100.0} | {c: rng.normal(size=300) for c in "abcdef"}
    path = tmp_path / "good.parquet"
    frame = polars.DataFrame(columns).with_columns(polars.Series("text", ["x", "yz", "z"] * 100))
    frame.write_parquet(path, compression=request.param, row_group_size=120, data_page_size=400)
    assert parquet_frame(path).equals(frame)
    assert tuple(parquet_schema(path)[0]) == tuple(frame.columns)
    return path


def test_sizes_that_polars_would_allocate_are_refused(good, tmp_path):
    """A number of values of a page header, made negative as one flipped bit does."""
    data = bytearray(good.read_bytes())
    damaged = tmp_path / "damaged.parquet"
    where = data.index(b"\x2c\x15")  # header of a data page, then its first number
    data[where + 2] ^= 1
    damaged.write_bytes(data)
    with pytest.raises(InputError, match="damaged"):
        parquet_frame(damaged)


def test_flipped_bytes_of_footer_and_headers_never_leave_this_process(good, tmp_path):
    """Whatever is let through, Polars reads or refuses (an abort would end the tests)."""
    data = good.read_bytes()
    rng = np.random.default_rng(8)
    footer = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    damaged = tmp_path / "damaged.parquet"
    refused = 0
    for place in rng.integers(footer, len(data), 150):
        wrong = bytearray(data)
        wrong[place] = rng.integers(256)
        damaged.write_bytes(wrong)
        try:
            parquet_schema(damaged)
            parquet_frame(damaged)
        except InputError:
            refused += 1
    assert refused > 50


@pytest.mark.parametrize("kept", [4, 11, 200, -1, -9])
def test_a_file_cut_short_is_refused(good, tmp_path, kept):
    damaged = tmp_path / "damaged.parquet"
    damaged.write_bytes(good.read_bytes()[:kept])
    with pytest.raises(InputError, match="damaged"):
        parquet_frame(damaged)


def test_nested_columns_of_others_can_be_opened(tmp_path):
    path = tmp_path / "nested.parquet"
    frame = polars.DataFrame({"t": [0.0, 1.0], "lists": [[1, 2, 3], []], "s": [{"a": 1}, {"a": 2}]})
    frame.write_parquet(path)
    assert parquet_frame(path).equals(frame)
