# SPDX-License-Identifier: GPL-3.0-or-later
"""What the weights folder has, as Preferences show it and keep it: no panel reads a file."""

import json

from ... import preferences
from ...binding.errors import StippleError
from ...binding.structs import WeightsState
from ...binding.weights import Weights
from ..source import sources

# What of a WeightsFile is kept; the time and the size tell whether a hash still holds.
_KEPT = ('label', 'path', 'size', 'published_size', 'modified', 'published_path', 'published_sha256', 'sha256',
         'licence')
STATE_TEXTS = {WeightsState.MISSING: "Missing", WeightsState.OTHER_SIZE: "Another size than the published file",
               WeightsState.UNCHECKED: "Size as published, content not checked",
               WeightsState.PUBLISHED: "As published, SHA-256 checked",
               WeightsState.OTHER_CONTENT: "SHA-256 differs from the published file's",
               WeightsState.TRAINED: "Trained by Stipple", WeightsState.NOT_NEEDED: "Not needed"}
_OWN = WeightsState.TRAINED, WeightsState.NOT_NEEDED
OWN_NETWORKS = "These networks were trained by Stipple: they know the objects of their collection, and nothing else."
SHIPPED_NETWORKS = ("These small networks came with Stipple. They know rocks, plants in pots and bottles, and make "
                    "everything into one of these. For anything else choose a Weights Folder in the preferences.")
NOT_TRIED = ("The structure of these networks was verified on small ones with random weights. We have never run the "
             "published weights.")


def folder():
    """The weights folder of Preferences, or that of the networks that came with the add-on."""
    return preferences.weights_folder()


def is_shipped():
    """Whether the networks are those that came with the add-on: then there is nothing to look for."""
    return bool(preferences.shipped_weights_folder()) and not preferences.chosen_weights_folder()


def caution():
    """What who uses the networks should know."""
    if is_shipped():
        return SHIPPED_NETWORKS
    return OWN_NETWORKS if is_trained() else NOT_TRIED


def rows():
    """What is known of the files: dictionaries of _KEPT and their WeightsState as 'state'; () where the folder was not
    looked through yet."""
    return tuple(dict(row, state=_state_of(row)) for row in _stored().get('files', ()))


def notes():
    return tuple(_stored().get('notes', ()))


def source():
    """Where users get the files, '' where it is not known yet."""
    return _stored().get('source', '')


def is_trained():
    """Whether the networks were trained by Stipple, and know what was in its collection alone."""
    return is_shipped() or any(row['state'] == WeightsState.TRAINED for row in rows())


def is_complete():
    return is_shipped() or bool(rows()) and all(row['state'] != WeightsState.MISSING for row in rows())


def refresh():
    """Looks through the folder. Hashes of files that have not changed stay known. Errors: StippleError."""
    _keep(Weights.find(sources.context(), folder()))


def check_start():
    """A job that compares the files with the published ones; keep_checked() takes it when it is done."""
    return Weights.find(sources.context(), folder()).check_start()


def keep_checked(job):
    _keep(Weights.of_job(job))


def on_folder_change(chosen, _context):
    """Update function of the folder."""
    chosen.weights_table = ''
    if not chosen.weights_folder:
        return
    try:
        refresh()
    except StippleError as error:
        chosen.weights_table = json.dumps({'folder': folder(), 'files': [], 'notes': [str(error)]})


def _keep(found):
    known = {_key(row): row['sha256'] for row in _stored().get('files', ()) if row['sha256']}
    files = []
    for file in found.files():
        row = {name: getattr(file, name) for name in _KEPT}
        row['sha256'] = row['sha256'] or known.get(_key(row), '')
        row['own'] = int(file.state) if file.state in _OWN else None
        files.append(row)
    chosen = preferences.get()
    chosen.weights_table = json.dumps({'folder': folder(), 'files': files, 'notes': found.notes(),
                                       'source': found.source()})


def _key(row):
    return row['path'], row['size'], row['modified']


def _state_of(row):
    """As the library judges it; of what is kept."""
    if row.get('own') is not None:
        return WeightsState(row['own'])
    if not row['path']:
        return WeightsState.MISSING
    if row['size'] != row['published_size']:
        return WeightsState.OTHER_SIZE
    if not row['sha256']:
        return WeightsState.UNCHECKED
    same = row['sha256'] == row['published_sha256']
    return WeightsState.PUBLISHED if same else WeightsState.OTHER_CONTENT


def _stored():
    chosen = preferences.get()
    try:
        values = json.loads(chosen.weights_table) if chosen is not None and chosen.weights_table else {}
    except ValueError:
        return {}
    return values if isinstance(values, dict) and values.get('folder') == folder() else {}
