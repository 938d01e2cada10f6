"""Follows a guide of docs/guides literally: applies its blocks to copies of the files that they name, and builds what
has changed beside the build that is there.

A block of code is applied by the line above it:
    New file `PATH`:                     the block is the file
    In `PATH`, below `LINE`:             the block goes below the one line of the file that is LINE
    In `PATH`, above `LINE`:             ... or above it
Blocks of `sh` are commands, one in each line."""
import json
import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get('STIPPLE_BUILD_DIR') or ROOT / 'build' / 'release').resolve()
CAPTION = re.compile(r'^(?:New file `(?P<new>[^`]+)`|In `(?P<path>[^`]+)`, (?P<where>below|above) `(?P<line>[^`]+)`):$')


class GuideError(Exception):
    """A guide that cannot be followed."""


def blocks(text):
    """[(caption match or None, language, code)] of a page, in its order."""
    found = []
    for block in re.finditer(r'^(?P<above>[^\n]*)\n\n```(?P<language>\w+)\n(?P<code>.*?)^```$', text,
                             flags=re.M | re.S):
        found.append((CAPTION.match(block['above']), block['language'], block['code']))
    return found


class Guide:
    """A page, and the tree that it makes in a folder."""

    def __init__(self, name, folder, root=ROOT):
        self.page = Path(root) / 'docs' / 'guides' / f'{name}.md'
        self.root, self.folder = Path(root), Path(folder)
        self.text = self.page.read_text(encoding='utf-8')
        self.touched = []   # paths below the root, in the order of the page
        self.commands = []

    def follow(self):
        """Applies every block."""
        for caption, language, code in blocks(self.text):
            if language == 'sh':
                self.commands += [line for line in code.splitlines() if line.strip()]
            elif caption is None:
                raise GuideError(f'{self.page.name}: a block of {language} does not say which file it is for:\n{code}')
            elif caption['new']:
                self._create(caption['new'], code)
            else:
                self._insert(caption['path'], caption['line'], caption['where'], code)
        return self

    def _touch(self, path):
        if path not in self.touched:
            self.touched.append(path)
        target = self.folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        return target

    def _create(self, path, code):
        if (self.root / path).exists():
            raise GuideError(f'{self.page.name}: the new file {path} is there already')
        self._touch(path).write_text(code, encoding='utf-8')

    def _insert(self, path, line, where, code):
        target = self._touch(path)
        if not target.exists():
            shutil.copyfile(self.root / path, target)
        lines = target.read_text(encoding='utf-8').splitlines(keepends=True)
        places = [i for i, each in enumerate(lines) if each.strip() == line]
        if len(places) != 1:
            raise GuideError(f'{self.page.name}: {path} has the line {line!r} {len(places)} times; once is expected')
        lines.insert(places[0] + (where == 'below'), code)
        target.write_text(''.join(lines), encoding='utf-8')

    def sources(self):
        return [path for path in self.touched if path.endswith('.cpp')]

    def count(self, *words):
        """Says how many files the page touches, of those whose path has one of the words where there are any."""
        files = [path for path in self.touched if not words or any(word in path for word in words)]
        print(f'{self.page.name}: {len(files)} files touched: {", ".join(files)}')
        return len(files)

    def build_library(self):
        """libstipple.so with the changed sources, in the folder's lib; its path."""
        objects = [_compile(self.root, self.folder, path) for path in self.sources()]
        library = self.folder / 'lib' / 'libstipple.so'
        library.parent.mkdir(exist_ok=True)
        # Before the static libraries, whose members of the same sources are then passed over.
        command = _commands_of('lib/libstipple.so')[-1].replace('-o lib/libstipple.so', ' '.join(
            ['-o', shlex.quote(str(library)), *map(shlex.quote, map(str, objects))]), 1)
        _run(command, BUILD, shell=True)
        for name in ('libstipple_media.so', 'libstipple_packing.so', 'libstipple_nn.so'):
            if (BUILD / 'lib' / name).exists():
                (library.parent / name).symlink_to(BUILD / 'lib' / name)
        return library

    def run(self, *arguments, status=0, environment=None):
        """The tool with the library that was built: its standard output."""
        environment = {**os.environ, **(environment or {}), 'LD_LIBRARY_PATH': str(self.folder / 'lib')}
        result = subprocess.run([str(BUILD / 'bin' / 'stipple'), *map(str, arguments)], capture_output=True, text=True,
                                cwd=self.folder, env=environment, timeout=120)
        assert result.returncode == status, (arguments, result.stdout, result.stderr)
        return result.stdout if status == 0 else result.stderr

    def run_command(self, command):
        """A line of a shell: variables of the environment, and the tool with its arguments."""
        words = shlex.split(command)
        environment = {}
        while '=' in words[0]:
            name, environment[name] = words.pop(0).split('=', 1)
        assert words[0] == 'stipple', command
        return self.run(*words[1:], environment=environment)

    def run_commands(self):
        """The page's commands, {command: output}."""
        return {command: self.run_command(command) for command in self.commands}


def _commands_of(target):
    result = subprocess.run(['ninja', '-C', str(BUILD), '-t', 'commands', target], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return result.stdout.strip().splitlines()


def _compile(root, folder, path):
    """Compiles a source as the build compiles it, or, where it is new, as one of the same folder; the object."""
    known = {Path(entry['file']): entry['command']
             for entry in json.loads((BUILD / 'compile_commands.json').read_text())}
    original = Path(root) / path
    like = original
    while like not in known:
        near = sorted(file for file in known if like.parent in file.parents)
        like = near[0] if near else like.parent
    words = [word for word in shlex.split(known[like]) if not word.endswith('ccache')]
    words[words.index('-o') + 1] = made = str(folder / (path.replace('/', '_') + '.o'))
    words[words.index('-c') + 1] = str(folder / path)
    # What the page changes comes before what is there.
    words.insert(1, f'-I{folder / "native"}')
    _run(words, BUILD)
    return made


def _run(command, folder, shell=False):
    result = subprocess.run(command, cwd=folder, shell=shell, capture_output=True, text=True)
    assert result.returncode == 0, f'{command}\n{result.stdout}\n{result.stderr}'
