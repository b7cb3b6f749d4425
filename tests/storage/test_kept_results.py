"""Results stay in memory as long as their files are the same."""

from dataclasses import replace

import numpy as np
import pytest
from common import dataset_of

from mapmore_cli.storage.artefacts import write_dataset
from mapmore_cli.storage.run_folder import DATASET, RunFiles


def write(folder, slope, step=1):
    columns = {"strain": np.arange(5.0), "force": slope * np.arange(5)}
    made = dataset_of(columns, output="force")
    force = np.repeat(columns["force"], step)[::step]
    curve = replace(made.curves[0], columns={**columns, "force": force})
    made = replace(made, curves=(curve,))
    write_dataset(folder / DATASET, made)
    return made


def test_results_stay_in_memory_until_their_file_is_replaced(tmp_path):
    first = write(tmp_path, 2.0)
    assert RunFiles(tmp_path).dataset() is first
    assert not first.curves[0].columns["force"].flags.writeable
    # in a file, all arrays are contiguous
    other = write(tmp_path, 2.0, step=2)
    first = RunFiles(tmp_path).dataset()
    assert first is not other
    assert RunFiles(tmp_path).dataset() is first
    with pytest.raises(ValueError, match="read-only"):  # nobody changes what others read
        first.curves[0].columns["force"][0] = 1.0
    write(tmp_path, 3.0)
    assert RunFiles(tmp_path).dataset().curves[0].columns["force"][1] == 3.0
