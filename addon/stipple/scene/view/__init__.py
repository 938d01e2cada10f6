# SPDX-License-Identifier: GPL-3.0-or-later
"""What a picture is asked for: cameras, effects, layers, quality."""
