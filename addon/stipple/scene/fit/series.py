# SPDX-License-Identifier: GPL-3.0-or-later
"""Photographs of things that move: which frames of a data set a fit uses."""

from ...binding.errors import invalid

# Models of a fit that learn from views at several times.
MOVING_MODELS = 'MOTION', 'RELAY'


def options_of(settings):
    """Fields of StippleViewsOpenOptions of a fit's settings; none of a fit that knows no time. Errors: StippleError that
    says what to change."""
    if settings.model not in MOVING_MODELS:
        return {}
    found = {'with_frames': 1, 'frame_rate': settings.series_rate, 'frame_step': settings.series_step,
             'max_images': settings.image_count}
    if not settings.series_whole:
        if settings.series_last < settings.series_first:
            raise invalid(f'Last is frame {settings.series_last}, before First, frame {settings.series_first}; Last must '
                          'come later.')
        found.update(first_frame=settings.series_first, last_frame=settings.series_last)
    if settings.held_out_names.strip():
        found['held_out_cameras_utf8'] = settings.held_out_names.encode()
    return found


def used(info):
    """A sentence on what of a data set is used, or '' where all is, or it has one time. info: StippleViewsInfo."""
    if info.frame_count < 2 or info.view_count == info.found_count:
        return ''
    return (f'{info.view_count:,} of {info.found_count:,} images are used, of {info.frame_count:,} times; Images, in '
            'Advanced, allows more.')
