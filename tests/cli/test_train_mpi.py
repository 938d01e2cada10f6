"""`stipple-train-mpi`: processes that learn together learn what one learns, and none of them waits for a dead one."""
import json
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from ball_collection import config, objects  # noqa: F401
from fit_dataset import TOOL, run
from test_train import FLOW

PROGRAM = TOOL.with_name('stipple-train-mpi')
MPIRUN = shutil.which('mpirun')
PATIENCE = 120  # seconds; all of it passes only where something hangs


def why_not():
    if not PROGRAM.exists():
        return 'MPI is not on this machine, so stipple-train-mpi is not built'
    if MPIRUN is None:
        return 'mpirun is not on this machine'
    if 'Open MPI' not in subprocess.run([MPIRUN, '--version'], capture_output=True, text=True).stdout:
        return "mpirun is not Open MPI's, whose options these tests use"
    return 'Open MPI leaks by itself' if os.environ.get('STIPPLE_SANITIZE') == 'ON' else None


pytestmark = pytest.mark.skipif(why_not() is not None, reason=str(why_not()))


@pytest.fixture
def given(objects, tmp_path):
    """Writes a config of four objects a step beside the collection, and returns its path."""
    (tmp_path / 'objects').symlink_to(objects)

    def write(name, batch=4, flow=None, **steps):
        parts = [dict(part, batch=batch, steps=steps[part['stage']]) for part in config()['parts']
                 if part['stage'] in steps]
        settings = config(parts=parts, out=name, checkpoint_interval=20)
        if flow:
            settings['flow'] = dict(FLOW, steps=flow)
        (tmp_path / f'{name}.json').write_text(json.dumps(settings))
        return tmp_path / f'{name}.json'

    return write


def started(*commands, grace=1):
    """In: for each group of processes, their number and the program's arguments; grace: seconds from the first signal
    to those that end, all of which Open MPI waits."""
    line = [MPIRUN, '--oversubscribe', '--bind-to', 'none', '--mca', 'odls_base_sigkill_timeout', str(grace)]
    line += ['--allow-run-as-root'] if os.geteuid() == 0 else []
    for i, (count, *arguments) in enumerate(commands):
        line += [':'] * (i > 0) + ['-n', str(count), str(PROGRAM), *map(str, arguments), '--threads', '1']
    return subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process):
    """Exit status, stdout and stderr; whoever hangs is ended, and the test with it."""
    try:
        out, err = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        for pid in [*ranks(process).values(), process.pid]:
            os.kill(pid, signal.SIGKILL)
        raise
    return process.returncode, out, err


def ranks(process):
    """Process ids of the ranks that an mpirun has started on this machine."""
    found = {}
    for folder in Path('/proc').glob('[0-9]*'):
        try:
            parent = (folder / 'stat').read_text().rpartition(')')[2].split()[1]
            rank = re.search(rb'OMPI_COMM_WORLD_RANK=(\d+)', (folder / 'environ').read_bytes())
        except OSError:
            continue
        if int(parent) == process.pid and rank:
            found[int(rank.group(1))] = int(folder.name)
    return found


def tensors(path):
    """name -> numbers of a file of float32 or uint64 tensors; others are left out."""
    data = path.read_bytes()
    size = int.from_bytes(data[:8], 'little')
    kinds = {'F32': np.float32, 'U64': np.uint64}
    return {name: np.frombuffer(data[8 + size:], kinds[entry['dtype']],
                                (entry['data_offsets'][1] - entry['data_offsets'][0]) // kinds[entry['dtype']]().nbytes,
                                entry['data_offsets'][0])
            for name, entry in json.loads(data[8:8 + size]).items()
            if name != '__metadata__' and entry['dtype'] in kinds}


def wait_for(path):
    deadline = time.monotonic() + PATIENCE
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert path.exists()


def test_processes_learn_what_one_learns(given, tmp_path):
    steps = dict(structure=20, attributes=30, joint=15, flow=25)
    run('train', given('alone', **steps))
    status, out, err = ended(started((4, given('together', **steps), '--json')))
    assert status == 0, err
    seen = json.loads(out)
    assert seen['processes'] == 4 and seen['steps'] == 90 and seen['skipped_steps'] == 0
    assert sorted(path.name for path in (tmp_path / 'together').iterdir()) == [
        'flow.safetensors', 'report.json', 'report.svg', 'weights.safetensors']
    # Sums of float32 in another order: 2e-7 of the largest weight is seen, and steps by other objects are 1e-2 away.
    for name in ('weights.safetensors', 'flow.safetensors'):
        alone, together = (tensors(tmp_path / folder / name) for folder in ('alone', 'together'))
        assert alone.keys() == together.keys() and len(alone) > 20
        largest = max(np.abs(values).max() for values in alone.values() if values.size)
        for key in alone:
            assert np.abs(alone[key] - together[key]).max(initial=0) < 1e-5 * largest, key
    alone, together = (json.loads((tmp_path / folder / 'report.json').read_text()) for folder in ('alone', 'together'))
    assert together['by_step']['loss'] == pytest.approx(alone['by_step']['loss'], rel=1e-4)
    assert together['by_budget'][-1]['psnr'] == pytest.approx(alone['by_budget'][-1]['psnr'], abs=1e-2)


def test_processes_learn_a_flow_for_networks_that_were_learned_with_fewer_objects_a_step(given, tmp_path):
    run('train', given('first', batch=2, structure=20))
    fields = config(out='second', start='first/weights.safetensors', flow=dict(FLOW, steps=20))
    path = tmp_path / 'second.json'
    path.write_text(json.dumps({key: fields[key] for key in fields if key not in ('parts', 'network')}))
    status, out, err = ended(started((4, path, '--json')))
    assert status == 0 and json.loads(out)['steps'] == 20, err
    assert (tmp_path / 'second/flow.safetensors').exists()


@pytest.mark.parametrize('sent, rank, message', [
    (signal.SIGKILL, 2, 'exited on signal 9'),  # as mpirun says it
    (signal.SIGTERM, 1, 'process 1 of 4 cannot go on: stopped by SIGTERM'),
    (signal.SIGTERM, None, 'stipple-train-mpi: stopped by SIGTERM')], ids=['killed', 'stopped', 'all-stopped'])
def test_a_training_that_loses_a_process_ends_with_a_checkpoint_of_its_last_step(given, tmp_path, sent, rank, message):
    path, checkpoint = given('lost', structure=40, attributes=400), tmp_path / 'lost/checkpoint.stipple.safetensors'
    process = started((4, path), grace=3)
    wait_for(checkpoint)
    assert sorted(ranks(process)) == [0, 1, 2, 3]
    os.kill(process.pid if rank is None else ranks(process)[rank], sent)
    status, _, err = ended(process)
    assert status != 0 and message in err and ranks(process) == {}, err
    step = int(re.search(r'stipple-train-mpi: stopped after step (\d+); the same command with --resume', err).group(1))
    assert tensors(checkpoint)['counts'][3] == step
    assert not (tmp_path / 'lost/weights.safetensors').exists()
    if rank is None:
        assert 'left from a training that was stopped' in ended(started((2, path)))[2]
        status, out, err = ended(started((2, path, '--resume', '--json')))
        assert status == 0 and json.loads(out)['steps'] == 440, err
    else:
        run('train', path, '--resume')  # by one process
    assert len(json.loads((tmp_path / 'lost/report.json').read_text())['by_step']['loss']) == 440
    assert not checkpoint.exists()


def test_what_cannot_be_learned_together_is_refused_by_one_sentence(given, tmp_path):
    def error(*commands):
        status, _, err = ended(started(*commands))
        lines = [line for line in err.splitlines() if line.startswith('stipple-train-mpi: ')]
        assert status != 0 and len(lines) == 1, err
        return lines[0]

    assert 'a step of part 0 is 2, and 3 processes share them' in error((3, given('few', batch=2, structure=20)))
    assert 'a step of the flow is 4, and 5 processes' in error((5, given('flow', batch=5, structure=20, flow=20)))
    assert 'nothing.json cannot be opened' in error((2, tmp_path / 'nothing.json'))
    # Of the others one alone has something to say.
    one, other = given('one', structure=20), given('other', structure=30)
    assert 'the settings of the 2 processes differ' in error((1, one), (1, other))
    assert 'process 1 of 2 cannot go on: ' in error((1, one), (1, tmp_path / 'nothing.json'))
    assert not (tmp_path / 'one/weights.safetensors').exists()
    assert ended(started((2, '--help')))[0] == 0 and ended(started((2,)))[0] != 0
