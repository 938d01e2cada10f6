# SPDX-License-Identifier: GPL-3.0-or-later
"""Data that networks are trained with."""

from . import collect_for_training

classes = collect_for_training.classes
