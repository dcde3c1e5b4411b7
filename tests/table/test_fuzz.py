"""Whatever the bytes: one line and no more than seconds and a gigabyte, or a table."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.read import read_table
from tests.table.test_read import FORMS, named, spreadsheet, truth

WHOLE = [one.encode() for one in FORMS.values()]
WHOLE += [json.dumps(one).encode() for one in named(*truth().tolist()).values()]


def reads_or_says(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    try:
        table = read_table(path, 30.0)
    except InputError as error:
        assert path.name in str(error) and "\n" not in str(error)
        return
    assert table.position.shape[:2] == (len(table.names), len(table.axes))
    assert not np.isinf(table.position).any()


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A table cut off, with rows shuffled, with bytes put in, or in another encoding."""
    content = draw(st.sampled_from(WHOLE))
    kind = draw(st.sampled_from(["cut", "shuffled", "junk", "encoding", "doubled"]))
    at = draw(st.integers(0, len(content)))
    if kind == "cut":
        return content[at:] if draw(st.booleans()) else content[:at]
    if kind == "shuffled":
        return b"\n".join(draw(st.permutations(content.split(b"\n"))))
    if kind == "junk":
        return content[:at] + draw(st.binary(max_size=8)) + content[at:]
    if kind == "doubled":
        return content + content[at:]
    encoding = draw(st.sampled_from(["utf-16", "utf-32-be", "cp037", "utf-7", "gb18030", "cp437"]))
    return content.decode().encode(encoding, "replace")


CUT_IN_A_TIME = b"Z;0.2;0.3\n" + b"".join(
    b"2024-05-14T09:31:00.%d0Z;0.%d;0.4\n" % (n, n) for n in range(10, 30)
)
"""What is left of the first row reads as titles, and the times as the column called z."""


@settings(max_examples=300)
@given(content=damaged())
@example(content=CUT_IN_A_TIME)
@example(content=b'!{"t": [0.0, 0.04, 0.08], "x": [0.0, 0.08, 0.16]}')
@example(content="\n".join(f"{n * 0.04:.2f}" for n in range(20)).encode())
def test_damaged_tables(content: bytes, tmp_path_factory) -> None:
    reads_or_says(tmp_path_factory.getbasetemp() / "damaged.csv", content)


@settings(max_examples=200)
@given(content=st.one_of(st.binary(max_size=300), st.text(max_size=300).map(str.encode)))
def test_anything(content: bytes, tmp_path_factory) -> None:
    reads_or_says(tmp_path_factory.getbasetemp() / "anything.txt", content)


def test_damaged_spreadsheets(tmp_path: Path) -> None:
    whole = spreadsheet([["1", "2"]] * 12)
    for at in (8, len(whole) // 2, len(whole) - 4):
        reads_or_says(tmp_path / "cut.xlsx", whole[:at])
        reads_or_says(tmp_path / "holed.xlsx", whole[:at] + b"\0\xff" + whole[at + 2 :])


@pytest.mark.parametrize(
    "content, words",
    [
        (b"t,x,y\n" + b"0.1,0.2,0.3\n" * 1_000_000, "1000001 rows; at most 200000"),
        (b"1," * 10_000 + b"\n" + b"2," * 10_000 + b"\n", "10001 columns; at most 1000"),
        (b"1" * 5_000_000, "5000000 letters"),
    ],
    ids=["a_million_rows", "ten_thousand_columns", "one_line"],
)
def test_too_much_is_refused(content: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "large.csv"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        read_table(path)
