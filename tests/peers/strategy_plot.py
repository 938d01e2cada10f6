# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws processor seconds and PSNR of strategies as SVG: a panel for each scene, a mark for the mean of each
strategy."""

import math
import statistics
from html import escape

PANEL, MARGIN, GAP = (380, 300), (60, 40), 30   # pixels
COLOURS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#000000', '#999933', '#882255', '#44aa99',
           '#777777', '#f0e442')


def ticks(low, high, count=5):
    step = 10 ** math.floor(math.log10((high - low) / count))
    step *= next(factor for factor in (1, 2, 5, 10) if (high - low) / (step * factor) <= count)
    return [step * k for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def panel(rows, title, names, left, top):
    width, height = PANEL
    means = {name: [(row['processor_seconds'], row['psnr']) for row in rows if row['strategy'] == name]
             for name in names}
    means = {name: tuple(statistics.mean(values) for values in zip(*found)) for name, found in means.items() if found}
    seconds, quality = zip(*means.values())
    x_low, x_high = math.log10(min(seconds)) - 0.05, math.log10(max(seconds)) + 0.05
    y_low, y_high = min(quality) - 0.3, max(quality) + 0.3

    def place(x, y):
        return (left + (math.log10(x) - x_low) / (x_high - x_low) * width,
                top + (y_high - y) / (y_high - y_low) * height)

    parts = [f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#888"/>',
             f'<text x="{left + width / 2}" y="{top - 10}" text-anchor="middle" '
             f'font-weight="bold">{escape(title)}</text>']
    for value in ticks(10 ** x_low, 10 ** x_high):
        if value <= 0:
            continue
        x, _ = place(value, y_low)
        parts.append(f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{top}" y2="{top + height}" stroke="#ddd"/>'
                     f'<text x="{x:.1f}" y="{top + height + 16}" text-anchor="middle">{value:g}</text>')
    for value in ticks(y_low, y_high):
        _, y = place(10 ** x_low, value)
        parts.append(f'<line x1="{left}" x2="{left + width}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>'
                     f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{value:g}</text>')
    for name, (x, y) in means.items():
        x, y = place(x, y)
        parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{COLOURS[names.index(name) % len(COLOURS)]}"/>')
    return parts


def plot(rows, scenes):
    """In: rows with scene, strategy, processor_seconds and psnr; scenes: title by name. Returns: SVG text."""
    names = sorted({row['strategy'] for row in rows})
    shown = [scene for scene in scenes if any(row['scene'] == scene for row in rows)]
    columns = min(2, len(shown))
    lines = math.ceil(len(shown) / columns)
    width = MARGIN[0] + columns * (PANEL[0] + MARGIN[0]) + 130
    height = lines * (PANEL[1] + MARGIN[1] + GAP) + 20
    parts = []
    for index, scene in enumerate(shown):
        left = MARGIN[0] + index % columns * (PANEL[0] + MARGIN[0])
        top = MARGIN[1] + index // columns * (PANEL[1] + MARGIN[1] + GAP)
        parts += panel([row for row in rows if row['scene'] == scene], scenes[scene], names, left, top)
        parts.append(f'<text x="{left + PANEL[0] / 2}" y="{top + PANEL[1] + 34}" text-anchor="middle">processor '
                     f'seconds</text>'
                     f'<text transform="translate({left - 40},{top + PANEL[1] / 2}) rotate(-90)" text-anchor="middle">'
                     'PSNR of held-out views, dB</text>')
    for index, name in enumerate(names):
        y = MARGIN[1] + 10 + 18 * index
        parts.append(f'<circle cx="{width - 130}" cy="{y}" r="5" fill="{COLOURS[index % len(COLOURS)]}"/>'
                     f'<text x="{width - 120}" y="{y + 4}">{escape(name)}</text>')
    return (f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" font-family="sans-serif" '
            f'font-size="12"><rect width="100%" height="100%" fill="white"/>' + '\n'.join(parts) + '</svg>\n')
