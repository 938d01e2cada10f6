"""docs/guides/add_a_model_kind.md, followed literally: the tool decodes a model of the kind at any budget and time."""
import json
import struct

import conversion_table as conversions
import numpy as np
from guide import Guide


def write_asset(path, radius):
    """An asset of the page's kind, as its writer would make it."""
    header = json.dumps({'__metadata__': {'stipple_version': '1.0', 'kind': 'ring'},
                         'ring.radius': {'dtype': 'F32', 'shape': [1], 'data_offsets': [0, 4]}}).encode()
    path.write_bytes(struct.pack('<Q', len(header)) + header + struct.pack('<f', radius))


def test_the_guide_adds_a_kind_of_model(tmp_path):
    guide = Guide('add_a_model_kind', tmp_path / 'tree').follow()
    guide.build_library()
    assert guide.count() == 3

    write_asset(guide.folder / 'wheel.stipple.safetensors', 2.0)
    outputs = list(guide.run_commands().values())
    assert 'ring' in outputs[-1]
    still, later = (conversions.read_ply(guide.folder / name, 0)[:, :3] for name in ('still.ply', 'later.ply'))
    assert len(still) == len(later) == 100
    np.testing.assert_allclose(np.linalg.norm(still, axis=1), 2, rtol=1e-6)
    # A quarter of a second is a quarter of a rotation: x becomes y, the square root of 2 times the radius away.
    distance = np.linalg.norm(later - still, axis=1)
    np.testing.assert_allclose(distance, 2 * np.sqrt(2), rtol=1e-5)

    guide.run('decode', 'wheel.stipple.safetensors', 'few.ply', '--anchors', 7)
    assert json.loads(guide.run('info', 'few.ply', '--json'))['count'] == 7
    write_asset(guide.folder / 'flat.stipple.safetensors', 0.0)
    refused = guide.run('decode', 'flat.stipple.safetensors', 'no.ply', status=1)
    assert 'one number above 0 is needed' in refused
