from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from reading import refusal, table_of

from mapmore_cli.domain.errors import DataError

nptdms = pytest.importorskip("nptdms")
BY_LABVIEW = Path(nptdms.__file__).parent / "test" / "data"
T = np.arange(50.0)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "a.tdms"
    stamps = np.datetime64("1970-01-02T00:00:00") + (T * 1e6).astype("timedelta64[us]")
    with nptdms.TdmsWriter(str(path)) as writer:
        for half in (slice(0, 25), slice(25, 50)):
            channels = {
                "P": (100 + T)[half],
                "eps": (T / 100)[half].astype(np.float32),
                "stamp": stamps[half],
            }
            writer.write_segment(
                [nptdms.ChannelObject("Rig 7", name, values) for name, values in channels.items()]
            )
        writer.write_segment(
            [
                nptdms.ChannelObject("Rig 7", "short", T[:7]),
                nptdms.ChannelObject("Notes", "who", ["me", "you"]),
            ]
        )
    return path


read = partial(table_of, "tdms")


def test_channels_over_several_segments(file):
    table = read(file, "Rig 7/P", "Rig 7/eps", "Rig 7/stamp", clocks=frozenset({"Rig 7/stamp"}))
    np.testing.assert_array_equal(table.columns["Rig 7/P"], 100 + T)
    np.testing.assert_allclose(table.columns["Rig 7/eps"], T / 100, rtol=1e-6)
    np.testing.assert_allclose(table.columns["Rig 7/stamp"], 86_400 + T)
    assert table.at(3) == "a.tdms:index 3"


@pytest.mark.parametrize(
    ("columns", "parts"),
    [
        (("Rig 7/p",), ["a.tdms: there is no 'Rig 7' on the way", "Did you mean 'Rig 7/P'?"]),
        (("P",), ["there is no 'P'", "Rig 7/P, Rig 7/eps"]),
        (("Rig 7/stamp",), ["'Rig 7/stamp'", "a date, not a number"]),
        (("Notes/who",), ["'Notes/who' holds", "not real numbers"]),
        (("Rig 7/P", "Rig 7/short"), ["'Rig 7/short' has 7 samples, 'Rig 7/P' has 50"]),
    ],
)
def test_what_a_file_lacks(file, columns, parts):
    refusal(parts, "tdms", file, *columns)


@pytest.mark.parametrize(
    "name", ["raw1.tdms", "Digital_Input.tdms", "big_endian.tdms", "raw_timestamps.tdms"]
)
def test_files_that_labview_wrote(name):
    if not (BY_LABVIEW / name).is_file():
        pytest.skip("this npTDMS comes without its test files")
    with nptdms.TdmsFile.open(BY_LABVIEW / name) as whole:
        channels = {
            f"{group.name}/{channel.name}": channel[:]
            for group in whole.groups()
            for channel in group.channels()
        }
    column, expected = next((name, values) for name, values in channels.items() if len(values))
    got = read(BY_LABVIEW / name, column, clocks=frozenset({column})).columns[column]
    if expected.dtype.kind == "M":
        expected = [
            stamp.astype("datetime64[us]").astype(datetime).replace(tzinfo=UTC).timestamp()
            for stamp in expected
        ]
    np.testing.assert_allclose(got, expected)


def test_cut_files_are_noticed_and_read_where_the_spec_drops_what_is_missing(file, tmp_path):
    whole = file.read_bytes()
    second = whole.index(b"TDSm", 4)
    third = whole.index(b"TDSm", second + 4)
    cut = tmp_path / "cut.tdms"
    for end in {10, len(whole) - 1, *range(0, third, 37), *range(second + 1, second + 60)} - {
        0,
        second,
    }:
        cut.write_bytes(whole[:end])
        with pytest.raises(
            DataError, match=r"a\.tdms: the (last segment is incomplete|file is damaged)"
        ):
            read(cut, "Rig 7/P")
    cut.write_bytes(whole[: third - 300])
    with pytest.raises(DataError, match="the last segment is incomplete"):
        read(cut, "Rig 7/P")
    rescued = read(cut, "Rig 7/P", incomplete=True).columns["Rig 7/P"]
    assert 25 <= len(rescued) <= 50
    np.testing.assert_array_equal(rescued, 100 + T[: len(rescued)])
