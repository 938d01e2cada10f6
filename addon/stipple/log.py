# SPDX-License-Identifier: GPL-3.0-or-later
"""What goes wrong where no operator could report it, for the console that Blender was started from."""

import logging

_logger = logging.getLogger('stipple')
error, exception, warning = _logger.error, _logger.exception, _logger.warning
