# SPDX-License-Identifier: GPL-3.0-or-later
"""Where splats come from and go to: files, edits, attributes, and keeping them in step."""

from ... import late

__getattr__ = late.room(__name__)
