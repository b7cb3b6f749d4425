"""Read LabVIEW measurements (.tdms) with npTDMS. A column is `Group/Channel`, or `Channel` if every
group is a recording.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO, Literal

import numpy as np

from mapmore_cli.storage.tables import Cut, Noted, TableRequest, optional_library, reading
from mapmore_cli.storage.tables.cells import CellReader
from mapmore_cli.storage.tables.members import Member, as_numbers
from mapmore_cli.storage.tables.overview import tree_reader

# number of bytes before the contents of a segment: tag, flags, version, length and offset
LEAD_IN = 28
CUT = Cut(
    "the last segment is incomplete",
    "get it again; `missing: drop` reads the complete samples",
    "only its complete samples are read",
)


@contextmanager
def opened_tdms(path: Path, label: str, request: TableRequest | None) -> Iterator[Member]:
    """Open a file, and return a member that contains its groups, whose members are the channels.
    But for a request without `root`, the member contains all channels of the file with their full
    names, such as `Group/Channel`.

    Numbers are scaled as LabVIEW shows them. Raises DataError if the file is no TDMS file or is
    damaged, and if npTDMS is not installed.
    """
    nptdms = optional_library("nptdms", "npTDMS", label)
    # npTDMS would print messages on stderr about faults that also raise an error below
    nptdms.log.log_manager.set_level("CRITICAL")
    with reading(label, "TDMS file"), path.open("rb") as stream:
        cut = CUT if request is not None and _breaks_off(stream) else None
        size = stream.seek(0, os.SEEK_END)
        stream.seek(0)
        with nptdms.TdmsFile.open(stream) as file:
            groups = {
                group.name: [
                    (channel.name, _channel(channel, size)) for channel in group.channels()
                ]
                for group in file.groups()
            }
            if request is None or request.root is not None:
                top = _in_order([(name, _in_order(group)) for name, group in groups.items()])
                yield replace(top, breaks_off=cut)
            else:
                # A full name can be ambiguous: `a/b/c` is `c` in the group `a/b`, or `b/c` in `a`.
                whole = _in_order(
                    [
                        (f"{group}/{name}", channel)
                        for group, channels in groups.items()
                        for name, channel in channels
                    ]
                )
                yield replace(whole, breaks_off=cut)


def _in_order(members: Sequence[tuple[str, Member]]) -> Member:
    """Return a group of the given members; its order is the order in which they were written."""
    names, every = [name for name, _ in members], [member for _, member in members]
    kind = f"a group of {len(every)}"
    return Member(kind, names, dict(members).__getitem__, len(every), every.__getitem__)


def _channel(channel: Any, size: int) -> Member:
    """Return a channel as a member. Raises ValueError if it declares more values than a file of
    `size` bytes can contain; each value takes at least one byte.
    """
    if len(channel) > size:
        raise ValueError(
            f"'{channel.name}' declares {len(channel)} values, more than the file can hold"
        )
    return Member(
        "a channel",
        values=lambda selection: channel[selection[0]] if selection else channel[:],
        shape=(len(channel),),
        noted=_waveform(channel.properties),
    )


def _waveform(properties: Mapping[str, Any]) -> Noted:
    """Return the unit, the time step and the start time of a waveform from its properties."""
    start = properties.get("wf_start_time", np.datetime64(0, "s"))
    began = float(as_numbers(start, "wf_start_time", CellReader(clock=True)))
    return Noted(
        str(properties.get("unit_string", "")),
        float(properties.get("wf_increment", 0.0)),
        began + float(properties.get("wf_start_offset", 0.0)),
    )


def _breaks_off(stream: BinaryIO) -> bool:
    """Return True if the last segment of the file is incomplete. npTDMS would skip such a segment
    without a message. Therefore, the lengths at the beginning of all segments are added up here and
    compared with the size of the file.
    """
    size = stream.seek(0, os.SEEK_END)
    position = 0
    while position < size:
        stream.seek(position)
        lead_in = stream.read(LEAD_IN)
        if len(lead_in) < LEAD_IN:
            return True
        order: Literal["big", "little"] = "big" if lead_in[4] >> 6 & 1 else "little"
        # the length is 2^64 - 1 if LabVIEW crashed while it wrote the segment
        length = int.from_bytes(lead_in[12:20], order)
        position += LEAD_IN + length
    return position > size


READER = tree_reader(
    "tdms", opened_tdms, (".tdms",), "Group/Channel", by_index=False, begins=b"TDSm"
)
