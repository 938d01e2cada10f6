#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the add-on's tests inside `blender --background` with pytest.

    run.py [--blender blender] [--library libstipple.so] [pytest arguments...]

Blender sees a fresh user folder with the add-on of this working tree, so nothing of the user's own
set-up is read or changed. Every test starts from an empty file (conftest.py). What the tests and Blender
write is gone when they end. The exit code is pytest's.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
PROJECT = HERE.parent.parent
INSIDE = '''
import sys
sys.path[:0] = {paths!r}
import bpy
bpy.ops.preferences.addon_enable(module='stipple')
import pytest
code = pytest.main({arguments!r})
sys.stdout.flush()
import os
os._exit(int(code))
'''


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--blender', default=os.environ.get('STIPPLE_BLENDER', 'blender'))
    parser.add_argument('--library', type=Path,
                        default=os.environ.get('STIPPLE_LIBRARY',
                                               PROJECT / 'build' / 'release' / 'lib' / 'libstipple.so'))
    parser.add_argument('--addon', type=Path, default=PROJECT / 'addon' / 'stipple')
    options, arguments = parser.parse_known_args()
    blender = shutil.which(options.blender)
    if blender is None:
        print(f"Blender '{options.blender}' is not installed.", file=sys.stderr)
        return 1
    # Blender runs in a folder of its own: paths of tests become absolute.
    arguments = [str(Path(a).resolve()) if Path(a.partition('::')[0]).exists() else a for a in arguments]
    if not any(Path(a.partition('::')[0]).exists() for a in arguments):
        arguments.append(str(HERE))
    with tempfile.TemporaryDirectory(prefix='stipple-blender-') as folder:
        addons = Path(folder, 'user', 'scripts', 'addons')
        addons.mkdir(parents=True)
        # Blender ends by os._exit, so neither it nor pytest would ever remove its temporary files.
        temporary = Path(folder, 'temporary')
        temporary.mkdir()
        (addons / 'stipple').symlink_to(options.addon.resolve(), target_is_directory=True)
        # Debian's Blender asks the first python3 in PATH where its modules are: let that be the system's.
        environment = dict(os.environ, PATH=f"/usr/bin:{os.environ['PATH']}", PYTHONDONTWRITEBYTECODE='1',
                           BLENDER_USER_RESOURCES=str(Path(folder, 'user')), TMPDIR=str(temporary),
                           STIPPLE_LIBRARY=str(Path(options.library).resolve()))
        inside = INSIDE.format(paths=[str(HERE), '/usr/lib/python3/dist-packages'],
                               arguments=['-p', 'no:cacheprovider', f'--rootdir={HERE}'] + arguments)
        command = [blender, '--background', '--factory-startup', '--python-exit-code', '70',
                   '--python-expr', inside]
        return subprocess.run(command, env=environment, cwd=folder).returncode


if __name__ == '__main__':
    sys.exit(main())
