"""Packages of npm that tests compare with, installed once beside the build; without npm those tests are skipped."""
import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

SPLAT_TRANSFORM = '@playcanvas/splat-transform@3.7.0'
GLTF_VALIDATOR = 'gltf-validator@2.0.0-dev.3.10'
TINYUSDZ = 'tinyusdz@0.9.0-rc10'

_FOLDER = Path(os.environ['STIPPLE_BUILD_DIR']) / 'npm'


def node_package(package):
    """The folder of an installed package; skips the test where it cannot be had."""
    if not shutil.which('npm') or not shutil.which('node'):
        pytest.skip(f'npm is not installed: {package} is not compared with')
    folder = _FOLDER / package.replace('/', '_').replace('@', '_')
    name = package.rsplit('@', 1)[0]
    installed = folder / 'node_modules' / name
    if not (folder / 'complete').exists():
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        result = subprocess.run(['npm', 'install', '--no-audit', '--no-fund', '--prefix', str(folder), package],
                                capture_output=True, text=True, timeout=240)
        if result.returncode != 0:
            pytest.skip(f'npm cannot install {package}: {result.stderr.strip().splitlines()[-1:]}')
        (folder / 'complete').touch()
    return installed


def splat_transform(*arguments):
    """Runs PlayCanvas' converter."""
    program = node_package(SPLAT_TRANSFORM) / 'bin' / 'cli.mjs'
    result = subprocess.run(['node', str(program), *map(str, arguments)], capture_output=True, text=True, timeout=240)
    assert result.returncode == 0, (arguments, result.stdout, result.stderr)
    return result.stdout


def gltf_issues(path):
    """The messages of the Khronos validator on a glTF or GLB file: dictionaries with code, severity and pointer."""
    package = node_package(GLTF_VALIDATOR)
    script = f'''
        const validator = require({str(package)!r});
        const fs = require('fs'), path = require('path');
        const file = {str(path)!r};
        const load = uri => Promise.resolve(new Uint8Array(
            fs.readFileSync(path.join(path.dirname(file), decodeURIComponent(uri)))));
        validator.validateBytes(new Uint8Array(fs.readFileSync(file)), {{externalResourceFunction: load}})
            .then(report => console.log(JSON.stringify(report.issues.messages)));
    '''
    result = subprocess.run(['node', '-e', script], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def usd_layer(path):
    """A USD layer or package as tinyusdz reads it, printed as text."""
    package = node_package(TINYUSDZ)
    # It is built for browsers, and takes its module from bytes where it believes to be in one.
    script = f'''
        const fs = require('fs');
        process.type = 'renderer';
        globalThis.window = globalThis;
        import({str(package / 'tinyusdz.js')!r}).then(async module => {{
            const native = await module.default({{wasmBinary: fs.readFileSync({str(package / 'tinyusdz.wasm')!r})}});
            const loader = new native.TinyUSDZLoaderNative();
            const is_read = loader.loadAsLayerFromBinary(fs.readFileSync({str(path)!r}), {path.name!r});
            if (!is_read) throw new Error(loader.error());
            fs.writeSync(1, loader.layerToString());
        }});
    '''
    result = subprocess.run(['node', '-e', script], capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stderr
    return result.stdout
