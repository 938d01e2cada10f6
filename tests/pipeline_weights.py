# SPDX-License-Identifier: GPL-3.0-or-later
"""The small random networks of a golden pipeline, in four files as users have them, and its image."""

import hashlib
import json
import struct
from pathlib import Path

GOLDEN = Path(__file__).resolve().parent / 'data' / 'networks' / 'deg_pipeline_a.safetensors'
NETWORKS = ('dino', 'vae', 'flow', 'decoder')
CANVAS, TOKENS, STEPS = 64, 64, 4  # that the golden was made with


def read(golden=GOLDEN):
    """{name: (dtype, shape, bytes)} of a golden."""
    data = golden.read_bytes()
    length = struct.unpack('<Q', data[:8])[0]
    header = json.loads(data[8:8 + length])
    found = {}
    for name, entry in header.items():
        if name != '__metadata__':
            begin, end = entry['data_offsets']
            found[name] = (entry['dtype'], entry['shape'], data[8 + length + begin:8 + length + end])
    return found


def write(path, tensors, metadata=None):
    header, at = {'__metadata__': metadata} if metadata else {}, 0
    for name, (dtype, shape, data) in tensors.items():
        header[name] = {'dtype': dtype, 'shape': shape, 'data_offsets': [at, at + len(data)]}
        at += len(data)
    text = json.dumps(header).encode()
    text += b' ' * (-len(text) % 8)
    Path(path).write_bytes(struct.pack('<Q', len(text)) + text + b''.join(data for _, _, data in tensors.values()))


def split(folder):
    """Writes dino.safetensors, vae.safetensors, flow.safetensors and decoder.safetensors."""
    tensors = read()
    for network in NETWORKS:
        prefix = f'weights.{network}.'
        write(Path(folder) / f'{network}.safetensors',
              {name[len(prefix):]: value for name, value in tensors.items() if name.startswith(prefix)})


def write_large_decoder(path):
    """Writes the weights of another golden's decoder, which takes some 14 seconds of a processor for 31,250 anchors."""
    prefix = 'weights.'
    write(path, {name[len(prefix):]: value for name, value in read(GOLDEN.with_name('deg_decoder_b.safetensors')).items()
                 if name.startswith(prefix)})


def write_latent(path, decoder, tokens=TOKENS):
    """Writes the golden's latent as an asset that names a file of its decoder's weights."""
    content = Path(decoder).read_bytes()
    _, _, latent = read()['expect.sample.latent']
    metadata = {'stipple_version': '1.0', 'kind': 'latent', 'frame': 'right-handed, z up, unit cube',
                'weights_file': Path(decoder).name, 'weights_bytes': str(len(content)),
                'weights_sha256': hashlib.sha256(content).hexdigest(), 'settings': '{"seed": 42}'}
    write(path, {'latent.tokens': ('F32', [tokens, 16], latent[:tokens * 64]),
                 'latent.camera': ('F32', [5], struct.pack('<5f', 1, 0, 0, 0.5, 0.7))}, metadata)


def image():
    """The golden's image: (width, height, RGBA bytes, row 0 = top)."""
    _, (height, width, _), data = read()['input.image_rgba']
    return width, height, data
