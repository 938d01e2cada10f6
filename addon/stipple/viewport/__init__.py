# SPDX-License-Identifier: GPL-3.0-or-later
"""Splats drawn in the 3D view."""
