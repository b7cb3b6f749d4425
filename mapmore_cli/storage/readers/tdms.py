"""LabVIEW measurements (.tdms), read with npTDMS; a column is `Group/Channel`, or `Channel` where
every group is a recording.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    Noted,
    RawTable,
    Reader,
    SourceColumn,
    TableRequest,
    Top,
    known_names,
    optional_library,
    reading,
)
from mapmore_cli.storage.tables.cells import CellReader
from mapmore_cli.storage.tables.members import Member, as_numbers, table_of, tables, top_of

TAG = b"TDSm"
LEAD_IN = 28  # bytes: tag, flags, version, length of the segment, offset of its data
BIG_ENDIAN = 1 << 6


def read_tdms(path: Path, request: TableRequest) -> list[RawTable]:
    """Read the wanted channels, scaled as LabVIEW shows them; time stamps count as seconds since
    1970, in the column of the time.

    With `root: "[*]"` every group is a recording, and columns are channels; with `root: Group` it
    is that one.

    Raises
    ------
    DataError
        No TDMS file, or a damaged one; a missing channel, or one that holds no numbers; channels of
        different length; npTDMS not installed.
    """
    with _opened(path, request.label, whole=not request.incomplete) as file:
        if request.root is not None:
            return tables(_groups(file), request)
        channels = {
            f"{group.name}/{channel.name}": channel
            for group in file.groups()
            for channel in group.channels()
        }
        columns: dict[SourceColumn, Array] = {}
        noted: dict[SourceColumn, Noted] = {}
        for column in request.columns:
            if column not in channels:
                remedy = known_names(str(column), list(channels), "The file has")
                raise DataError(f"{request.label}: there is no channel '{column}'", remedy)
            columns[column] = as_numbers(
                channels[str(column)][:],
                f"{request.label}: channel '{column}'",
                request.cells(column),
            )
            noted[column] = _waveform(channels[str(column)].properties)
    return [table_of(columns, request, request.label, None, noted)]


def peek_tdms(path: Path, most: int) -> Iterable[Top]:
    """Return the first rows of the group with the longest channels; the step that LabVIEW noted is
    the sample time.
    """
    with _opened(path, path.name) as file:
        found = top_of(_groups(file), most)
        if "root" in found.settings:
            first = next(
                group
                for group in file.groups()
                if {*found.addresses} <= {channel.name for channel in group.channels()}
            )
            channels = [first[name] for name in found.addresses]
        else:
            channels = [
                file[group][channel]
                for group, channel in (address.split("/") for address in found.addresses)
            ]
        steps = [channel.properties.get("wf_increment") for channel in channels]
    return [
        replace(found, settings={**found.settings, "sample_time": steps[0]})
        if steps and steps[0]
        else found
    ]


@contextmanager
def _opened(path: Path, label: str, whole: bool = False) -> Iterator[Any]:
    """Open a file, which has to be `whole` where that is asked for."""
    nptdms = optional_library("nptdms", "npTDMS", label)
    nptdms.log.log_manager.set_level(
        "CRITICAL"
    )  # it writes to stderr what the message below says as well
    with reading(label, "TDMS file"), path.open("rb") as stream:
        if whole and _breaks_off(stream):
            raise DataError(
                f"{label}: the last segment breaks off",
                "get it again; `missing: drop` reads the samples that are whole",
            )
        stream.seek(0)
        with nptdms.TdmsFile.open(stream) as file:
            yield file


def _groups(file: Any) -> Member:
    """Return the groups of a file, in the order in which they were written."""
    groups = {
        group.name: _group({channel.name: channel for channel in group.channels()})
        for group in file.groups()
    }
    every = list(groups.values())
    return Member(
        f"a file of {len(groups)} groups",
        list(groups),
        groups.__getitem__,
        len(groups),
        every.__getitem__,
    )


def _group(channels: Mapping[str, Any]) -> Member:
    def member(name: str) -> Member:
        channel = channels[name]
        noted = _waveform(channel.properties)
        return Member(
            "a channel",
            values=lambda s: channel[s[0]] if s else channel[:],
            shape=(len(channel),),
            noted=noted,
        )

    return Member("a group", list(channels), member)


def _waveform(properties: Mapping[str, Any]) -> Noted:
    """Return what LabVIEW notes of a waveform."""
    start = as_numbers(
        properties.get("wf_start_time", np.datetime64(0, "s")),
        "wf_start_time",
        CellReader(clock=True),
    )
    later = float(properties.get("wf_start_offset", 0.0))
    return Noted(
        str(properties.get("unit_string", "")),
        float(properties.get("wf_increment", 0.0)),
        float(start) + later,
    )


def _breaks_off(stream: BinaryIO) -> bool:
    """Walk over the segments' lead-ins: npTDMS passes over one that is cut off in silence."""
    size = stream.seek(0, os.SEEK_END)
    position = 0
    while position < size:
        stream.seek(position)
        lead_in = stream.read(LEAD_IN)
        if len(lead_in) < LEAD_IN or not lead_in.startswith(TAG):
            return position > 0  # a file that does not begin as TDMS is another kind of fault
        order: Literal["big", "little"] = "big" if lead_in[4] & BIG_ENDIAN else "little"
        position += LEAD_IN + int.from_bytes(
            lead_in[12:20], order
        )  # 2^64 - 1 where LabVIEW crashed
    return position > size


READER = Reader(
    "tdms",
    read_tdms,
    suffixes=(".tdms",),
    keys=("root",),
    column="Group/Channel",
    by_index=False,
    peek=peek_tdms,
)
