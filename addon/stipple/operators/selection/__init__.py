# SPDX-License-Identifier: GPL-3.0-or-later
"""Selecting splats, and what is done with the selected ones."""

from . import (erase_selected, fill_erased, select_all, select_brush, select_color, select_grow, select_lasso,
               select_sphere, separate_selected)

classes = tuple(cls for module in (select_brush, select_lasso, select_sphere, select_color, select_grow, select_all,
                                   erase_selected, separate_selected, fill_erased) for cls in module.classes)
