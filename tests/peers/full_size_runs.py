# SPDX-License-Identifier: GPL-3.0-or-later
"""`stipple generate` in the published sizes, with weights that are made up: seconds, memory and how soon it stops.

    full_size_runs.py BUILD FOLDER run TOKENS CANVAS STEPS [ANCHORS...]
    full_size_runs.py BUILD FOLDER decode TOKENS ANCHORS...
    full_size_runs.py BUILD FOLDER cancel TOKENS CANVAS SECONDS...
    full_size_runs.py BUILD FOLDER table

BUILD: the build folder; FOLDER: of files of weights (full_size_weights), of results and of an image with alpha,
image.png, which is made where it is missing. `run` generates a latent, then decodes it with so many anchors each. It
prints and keeps each stage's seconds and operations, the rate of the library's own products of matrices before and
after, and the most memory. `decode` decodes such a latent again. `cancel` sends SIGINT after so many seconds each and prints how long the tool takes to end. `table`
makes a table of all runs that were kept.

STIPPLE_PRIORITY is put before each command ("chrt -f 10": other programs wait).
"""

import json
import os
import platform
import resource
import shlex
import signal
import struct
import subprocess
import sys
import threading
import time
import zlib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import pipeline_weights  # noqa: E402

_PRIORITY = shlex.split(os.environ.get('STIPPLE_PRIORITY', ''))
_SAMPLE_SECONDS = 0.02
_RATE_SECONDS = 1.0


class Watched:
    """A process whose most memory is known: 'anonymous' that no file lies behind, 'mapped' pages of files; MiB."""

    def __init__(self, arguments):
        self.most = {'anonymous': 0.0, 'mapped': 0.0}
        self.stages = []  # (seconds since the start, what the tool says it does)
        self._start = time.monotonic()
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        self._used_before = used.ru_utime + used.ru_stime
        self.process = subprocess.Popen([*_PRIORITY, *map(str, arguments)], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True)
        threading.Thread(target=self._watch, daemon=True).start()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.errors = []

    def _watch(self):
        while self.process.poll() is None:
            try:
                status = Path(f'/proc/{self.process.pid}/status').read_text()
            except OSError:
                return
            for line in status.splitlines():
                for key, name in (('RssAnon:', 'anonymous'), ('RssFile:', 'mapped')):
                    if line.startswith(key):
                        self.most[name] = max(self.most[name], int(line.split()[1]) / 1024)
            time.sleep(_SAMPLE_SECONDS)

    def _read(self):
        for line in self.process.stderr:
            self.errors.append(line.rstrip())
            self.stages.append((time.monotonic() - self._start, line.rstrip()))

    def finish(self):
        """(stdout, seconds, processor seconds)."""
        out = self.process.stdout.read()
        code = self.process.wait()
        self._reader.join()
        seconds = time.monotonic() - self._start
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        processor = used.ru_utime + used.ru_stime - self._used_before
        if code != 0:
            sys.exit(f'exit status {code}: ' + '\n'.join(self.errors))
        return out, seconds, processor


def machine():
    model = next((line.split(':')[1].strip() for line in Path('/proc/cpuinfo').read_text().splitlines()
                  if line.startswith('model name')), platform.processor())
    return f'{model}, {len(os.sched_getaffinity(0))} processors'


def rate(build, *sizes):
    """What full_size_rate says."""
    done = subprocess.run([*_PRIORITY, str(build / 'tests' / 'full_size_rate'), str(_RATE_SECONDS), *map(str, sizes)],
                          capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def write_image(path):
    """The image of the small golden networks."""
    width, height, rgba = pipeline_weights.image()

    def chunk(kind, data):
        return struct.pack('>I', len(data)) + kind + data + struct.pack('>I', zlib.crc32(kind + data))
    rows = b''.join(b'\0' + rgba[4 * width * y:4 * width * (y + 1)] for y in range(height))
    path.write_bytes(b'\x89PNG\r\n\x1a\n' + chunk(b'IHDR', struct.pack('>IIBBBBB', width, height, 8, 6, 0, 0, 0))
                     + chunk(b'IDAT', zlib.compress(rows)) + chunk(b'IEND', b''))


def generate_arguments(build, folder, out, tokens, canvas, steps):
    image = folder / 'image.png'
    if not image.exists():
        write_image(image)
    return [build / 'bin' / 'stipple', 'generate', image, out, '--weights', folder, '--tokens', tokens, '--canvas', canvas,
            '--steps', steps, '--timings', '--json']


def stages_of(figures):
    """{name: (seconds, operations)} in order."""
    return {name.removesuffix('.seconds'): (value, figures.get(name.removesuffix('seconds') + 'operations', 0))
            for name, value in figures.items() if name.endswith('.seconds')}


def model_path(folder, tokens):
    return folder / 'results' / f'latent_{tokens}.stipple.safetensors'


def decodes_of(build, folder, tokens, anchors):
    decodes = []
    for count in anchors:
        decoding = Watched([build / 'bin' / 'stipple', '--weights', folder, 'decode', model_path(folder, tokens),
                            folder / 'results' / 'decoded.ply', '--anchors', count])
        _, seconds, processor = decoding.finish()
        decodes.append({'anchors': count, 'seconds': seconds, 'processor_seconds': processor, 'memory': decoding.most,
                        'operations': rate(build, tokens, count)['decodes'][0]})
    return decodes


def decode(build, folder, tokens, anchors):
    found = {'rate': rate(build)['rate'], 'decodes': decodes_of(build, folder, tokens, anchors)}
    (folder / 'results' / f'decode_{tokens}_{"_".join(map(str, anchors))}.json').write_text(json.dumps(found, indent=1))
    print(f"{tokens} tokens; products of matrices {found['rate'] / 1e9:.0f} GFLOP/s")
    show_decodes(found)


def run(build, folder, tokens, canvas, steps, anchors):
    (folder / 'results').mkdir(exist_ok=True)
    model = model_path(folder, tokens)
    before = rate(build)
    watched = Watched(generate_arguments(build, folder, model, tokens, canvas, steps))
    out, seconds, processor = watched.finish()
    stages = stages_of(json.loads(out))
    decodes = decodes_of(build, folder, tokens, anchors)
    after = rate(build)
    found = {'machine': machine(), 'backend': after['backend'], 'instruction_sets': after['instruction_sets'],
             'threads': after['threads'], 'tokens': tokens, 'canvas': canvas, 'steps': steps,
             'processor_seconds': processor, 'rate': (before['rate'] + after['rate']) / 2, 'rates': [before['rate'], after['rate']], 'seconds': seconds,
             'stages': stages, 'memory': watched.most, 'decodes': decodes}
    (folder / 'results' / f'run_{tokens}_{canvas}_{steps}.json').write_text(json.dumps(found, indent=1))
    show(found)


def parts(found):
    """Seconds and operations of an image, of one step and of the rest, and of one step's mean."""
    steps = [value for name, value in found['stages'].items() if name == 'latent' or name.endswith('.tokens') and
             name.startswith('step')]
    image = [found['stages'][name] for name in ('structure.features', 'colour.moments', 'image.context')]
    step_seconds = sum(seconds for seconds, _ in steps) / len(steps)
    return {'image': sum(seconds for seconds, _ in image), 'image_operations': sum(work for _, work in image),
            'step': step_seconds, 'step_operations': steps[0][1],
            'rest': found['seconds'] - sum(seconds for seconds, _ in image) - step_seconds * len(steps)}


def whole(found, steps):
    """(seconds, operations, ratio to products of matrices) of a latent in so many steps."""
    of = parts(found)
    seconds = of['image'] + of['rest'] + steps * of['step']
    operations = of['image_operations'] + steps * of['step_operations']
    return seconds, operations, seconds / (operations / found['rate'])


def show(found):
    print(f"{found['machine']}; {found['backend']} with {found['instruction_sets']}, {found['threads']} threads")
    print(f"{found['tokens']} tokens, image of {found['canvas']}, {found['steps']} steps; products of matrices "
          f"{found['rates'][0] / 1e9:.0f} and {found['rates'][1] / 1e9:.0f} GFLOP/s before and after")
    for name, (seconds, work) in found['stages'].items():
        speed = f' {work / 1e12:8.3f} TFLOP {work / seconds / 1e9:6.0f} GFLOP/s' if work and seconds else ''
        print(f'  {name:22s} {seconds:8.2f} s{speed}')
    of = parts(found)
    print(f"  whole process {found['seconds']:.2f} s, {found['processor_seconds']:.2f} processor s: image {of['image']:.2f}, {found['steps']} steps of {of['step']:.2f}, "
          f"all else {of['rest']:.2f}")
    print(f"  memory at most: anonymous {found['memory']['anonymous']:.0f} MiB, mapped {found['memory']['mapped']:.0f} MiB")
    for steps in (10, 20):
        seconds, work, ratio = whole(found, steps)
        print(f'  {steps} steps: {seconds:.0f} s for {work / 1e12:.1f} TFLOP, {ratio:.2f} times products of matrices')
    show_decodes(found)


def show_decodes(found):
    for one in found['decodes']:
        work = sum(one['operations'].values())
        print(f"  {one['anchors']} anchors: {one['seconds']:.2f} s, {one['processor_seconds']:.2f} processor s, at most "
              f"{work / 1e12:.2f} TFLOP ({one['operations']['levels'] / 1e12:.2f} of levels), "
              f"{one['seconds'] * found['rate'] / work:.2f} times products; anonymous {one['memory']['anonymous']:.0f} MiB, "
              f"mapped {one['memory']['mapped']:.0f} MiB")


def cancel(build, folder, tokens, canvas, moments):
    longest = 0.0
    for moment in moments:
        watched = Watched(generate_arguments(build, folder, folder / 'cancelled.stipple.safetensors', tokens, canvas, 1))
        time.sleep(moment)
        if watched.process.poll() is not None:
            print(f'{moment:.2f} s: it had ended')
            continue
        stage = watched.stages[-1][1].strip() if watched.stages else 'nothing yet'
        sent = time.monotonic()
        watched.process.send_signal(signal.SIGINT)
        code = watched.process.wait()
        took = time.monotonic() - sent
        if code not in (128 + signal.SIGINT, -signal.SIGINT):
            sys.exit(f'exit status {code} after SIGINT')
        longest = max(longest, took)
        print(f'{moment:.2f} s, last said "{stage}": ended after {took:.3f} s', flush=True)
    print(f'longest {longest:.3f} s')


def table(folder):
    for path in sorted((folder / 'results').glob('run_*.json')):
        found = json.loads(path.read_text())
        of = parts(found)
        print(f"| {found['tokens']:,} | {found['canvas']} | {of['image_operations'] / 1e12:.1f} | {of['image']:.0f} | "
              f"{of['step_operations'] / 1e12:.2f} | {of['step']:.1f} | {whole(found, 10)[0]:.0f} | "
              f"{whole(found, 20)[0]:.0f} | {whole(found, 20)[2]:.2f} | {found['memory']['anonymous']:.0f} | "
              f"{found['memory']['mapped']:.0f} |")


def main(arguments):
    if len(arguments) < 3:
        sys.exit(__doc__)
    build, folder, what = Path(arguments[0]).resolve(), Path(arguments[1]).resolve(), arguments[2]
    if what == 'run':
        tokens, canvas, steps, *anchors = map(int, arguments[3:])
        run(build, folder, tokens, canvas, steps, anchors)
    elif what == 'decode':
        decode(build, folder, int(arguments[3]), [int(count) for count in arguments[4:]])
    elif what == 'cancel':
        cancel(build, folder, int(arguments[3]), int(arguments[4]), [float(moment) for moment in arguments[5:]])
    elif what == 'table':
        table(folder)
    else:
        sys.exit(__doc__)


if __name__ == '__main__':
    main(sys.argv[1:])
