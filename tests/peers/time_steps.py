#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Times whole training steps of OpenSplat and of training_step in turns, and prints the ratio.

    time_steps.py OPENSPLAT TRAINING_STEP SCENE

A step of OpenSplat is what longer runs take more than shorter ones, so that its start, reading and writing do not
count. The best of the rounds stands: another program of the machine can only make a run slower.
"""

import resource
import subprocess
import sys
import tempfile
import time

ROUNDS = 3
PEER_STEPS = (10, 40)  # before densification, which begins at 500
OUR_STEPS = 150
GOAL, AIM = 30, 60     # times as fast


def spent(command):
    """(seconds, processor seconds) of a program."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    passed = time.perf_counter() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return passed, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def peer_step(program, scene, output):
    runs = [spent([program, scene, '--cpu', '--num-downscales', '0', '-n', str(steps), '-o', output])
            for steps in PEER_STEPS]
    return [(long - short) / (PEER_STEPS[1] - PEER_STEPS[0]) for short, long in zip(*runs)]


def our_step(program, scene):
    result = subprocess.run([program, scene, str(OUR_STEPS)], check=True, capture_output=True, text=True)
    return [float(value) for value in result.stdout.split()], result.stderr.strip()


def main():
    peer, ours, scene = sys.argv[1:]
    best = {'OpenSplat': [1e9, 1e9], 'Stipple': [1e9, 1e9]}
    passes = ''
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(ROUNDS):
            measured = {'OpenSplat': peer_step(peer, scene, folder + '/splat.ply')}
            measured['Stipple'], text = our_step(ours, scene)
            if measured['Stipple'][0] < best['Stipple'][0]:
                passes = text
            best = {name: [min(pair) for pair in zip(best[name], measured[name])] for name in best}
    for name, (passed, processor) in best.items():
        print(f'{name:9} {1e3 * passed:8.2f} ms a step, {1e3 * processor:8.2f} ms of processors')
    print(f'          of ours: {passes}')
    ratios = [theirs / own for theirs, own in zip(best['OpenSplat'], best['Stipple'])]
    print(f'Stipple is {ratios[0]:.0f} times as fast ({ratios[1]:.0f} by processor time); goal {GOAL}, aim {AIM}')


if __name__ == '__main__':
    main()
