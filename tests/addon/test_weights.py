# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of weights through the binding, with the small networks of a golden."""

import hashlib
import sys
from pathlib import Path

import pytest

from stipple.binding.errors import StippleError
from stipple.binding.structs import WeightsRole, WeightsState
from stipple.binding.weights import Weights

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402


@pytest.fixture
def folder(tmp_path):
    pipeline_weights.split(tmp_path)
    return tmp_path


def test_files_are_found_and_hashed(context, folder):
    (folder / 'flow.safetensors').unlink()
    weights = Weights.find(context, folder)
    files = weights.files()
    assert [file.role for file in files] == list(WeightsRole)
    assert [Path(file.path).name for file in files] == ['dino.safetensors', 'vae.safetensors', '',
                                                        'decoder.safetensors']
    assert files[WeightsRole.FLOW].state == WeightsState.MISSING
    assert files[WeightsRole.DECODER].state == WeightsState.OTHER_SIZE
    assert files[WeightsRole.DECODER].size == (folder / 'decoder.safetensors').stat().st_size
    assert files[WeightsRole.DECODER].modified == (folder / 'decoder.safetensors').stat().st_mtime_ns
    assert all(file.sha256 == '' and len(file.published_sha256) == 64 for file in files)
    assert 'huggingface.co' in weights.source() and 'Meta' in files[0].licence
    job = weights.check_start()
    job.wait()
    checked = Weights.of_job(job).files()
    for file in checked:
        expected = hashlib.sha256(Path(file.path).read_bytes()).hexdigest() if file.path else ''
        assert file.sha256 == expected


def test_what_cannot_be_read_is_noted(context, folder):
    (folder / 'vae.safetensors').write_bytes(b'half a file')
    weights = Weights.find(context, folder)
    assert weights.files()[WeightsRole.COLOUR_ENCODER].path == ''
    assert len(weights.notes()) == 1 and 'vae.safetensors' in weights.notes()[0]


def test_a_folder_that_is_not_there_is_refused(context, tmp_path):
    with pytest.raises(StippleError, match='nothing_here'):
        Weights.find(context, tmp_path / 'nothing_here')
