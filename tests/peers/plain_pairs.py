#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""What effects cost a picture that has none: the full library against one without them, in interleaved pairs.

Run by hand: tests/peers/plain_pairs.py BUILD_DIR [PAIRS] [PICTURES]. Prints the median of the ratios of processor times
and its 95 % interval, by the order of the ratios (binomial, no assumption about their distribution).
"""
import subprocess
import sys
from math import comb
from pathlib import Path


def seconds(program, pictures):
    return float(subprocess.run([program, '--seconds', str(pictures)], check=True, capture_output=True,
                                text=True).stdout)


def interval(ratios):
    """Ratios between which the median lies in 95 % of all series of this length."""
    n, tail, k = len(ratios), 0.0, 0
    while tail + comb(n, k) / 2 ** n <= 0.025:
        tail += comb(n, k) / 2 ** n
        k += 1
    k = max(k - 1, 0)
    return ratios[k], ratios[n - 1 - k]


def main():
    folder = Path(sys.argv[1]) / 'tests'
    pairs = int(sys.argv[2]) if len(sys.argv) > 2 else 40
    pictures = int(sys.argv[3]) if len(sys.argv) > 3 else 10
    ratios = []
    for pair in range(pairs):
        names = ['full_pictures', 'plain_pictures']
        if pair % 2:  # neither is always the first
            names.reverse()
        times = {name: seconds(folder / name, pictures) for name in names}
        ratios.append(times['full_pictures'] / times['plain_pictures'])
    ratios.sort()
    low, high = interval(ratios)
    middle = (ratios[(pairs - 1) // 2] + ratios[pairs // 2]) / 2
    print(f'{pairs} pairs of {pictures} pictures: median ratio {middle:.4f}, 95 % interval {low:.4f} to {high:.4f}')


if __name__ == '__main__':
    main()
