"""native/install_dependencies.sh, run against a machine that is made of three small programs."""
import os
import pathlib
import re
import subprocess

import pytest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / 'native' / 'install_dependencies.sh'
LOG = 'apt.log'


def packages():
    listed = re.search(r'^packages=\(\n(.*?)^\)', SCRIPT.read_text(encoding='utf-8'), re.S | re.M).group(1)
    return [word for line in listed.splitlines() if not line.strip().startswith('#') for word in line.split()]


@pytest.fixture
def machine(tmp_path):
    """run(missing, apt): the script's result on a machine without the missing packages.
    apt: a shell fragment that is this machine's apt-get, or None where it has none."""
    programs = tmp_path / 'bin'
    programs.mkdir()
    for name in ('bash', 'env', 'cat'):
        (programs / name).symlink_to(f'/bin/{name}' if name != 'env' else '/usr/bin/env')

    def program(name, text):
        (programs / name).write_text(f'#!/bin/bash\n{text}\n', encoding='utf-8')
        (programs / name).chmod(0o755)

    def run(missing, apt='exit 0', user=0):
        (tmp_path / LOG).write_text('')
        program('id', f'echo {user}')
        program('dpkg-query',
                f'for last; do :; done; case " {" ".join(missing)} " in *" $last "*) exit 1;; esac; echo installed')
        if apt is not None:
            program('apt-get', f'echo "$@" >> {tmp_path / LOG}\n{apt}')
        result = subprocess.run(['bash', str(SCRIPT)], env={'PATH': str(programs)}, stdin=subprocess.DEVNULL,
                                capture_output=True, text=True)
        return result, (tmp_path / LOG).read_text().splitlines()
    return run


def test_every_package_is_listed_once():
    assert len(packages()) >= 20
    assert sorted(packages()) == sorted(set(packages()))


def test_nothing_is_installed_when_all_is_there(machine):
    result, calls = machine([])
    assert result.returncode == 0 and calls == []


def test_only_what_is_missing_is_installed(machine):
    result, calls = machine(['libtbb-dev', 'blender'])
    assert result.returncode == 0, result.stderr
    assert not any('update' in call.split() for call in calls)
    assert calls[-1] == 'install -y --no-install-recommends libtbb-dev blender'


def test_lists_are_updated_when_a_package_is_unknown(machine):
    known = f'case "$1 $2" in "install --simulate") exit 100;; esac'
    result, calls = machine(['libtbb-dev'], known)
    assert result.returncode == 0, result.stderr
    assert calls[1:] == ['update', 'install -y --no-install-recommends libtbb-dev']


def test_a_failed_installation_is_an_error(machine):
    result, calls = machine(['libtbb-dev'], 'case "$1 $2" in "install -y") exit 100;; esac')
    assert result.returncode != 0
    assert [call.split()[0] for call in calls] == ['install', 'install', 'update', 'install']


@pytest.mark.parametrize('apt, user, reason', [(None, 0, 'apt-get is not on this machine'),
                                               ('exit 0', 1000, 'run this as root')])
def test_what_stands_in_the_way_is_said_in_one_line(machine, apt, user, reason):
    result, calls = machine(['libtbb-dev'], apt, user)
    assert result.returncode == 1 and calls == []
    assert len(result.stderr.splitlines()) == 1 and reason in result.stderr and 'libtbb-dev' in result.stderr
