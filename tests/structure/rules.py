"""The rules of the project's structure. Each takes a folder (or a file) and gives a list of what breaks it.

The folders' include table is read from docs/architecture.md, so the page and the law are one.
"""
import ast
import collections
import os
import pathlib
import re
import subprocess

TOP_LEVEL = {'CMakeLists.txt', 'CMakePresets.json', 'LICENSE', 'README.md', '.gitignore', '.clang-format',
             '.ci', 'native', 'addon', 'tests', 'blend-fixtures', 'docs'}

# How a third-party header is recognised: package name of the table -> start of the included path.
THIRD_PARTY = {
    'oneTBB': r'(tbb|oneapi/tbb)/',
    'Eigen': r'Eigen/',
    'Highway': r'hwy/',
    'nanoflann': r'nanoflann\.hpp',
    'OpenVDB': r'(openvdb|Imath)/|blosc\.h',
    'OpenEXR': r'OpenEXR/',
    'libpng': r'png\.h',
    'libjpeg': r'jpeglib\.h',
    'tinygltf': r'tiny_gltf\.h',
    'OpenImageIO': r'OpenImageIO/',
    'libwebp': r'webp/',
    'nlohmann-json': r'nlohmann/',
    'minizip': r'(minizip/|zip\.h|unzip\.h)',
    'zlib': r'zlib\.h|zconf\.h',
    'zstd': r'(zstd|zdict)(_errors)?\.h',
    'CLI11': r'CLI/',
    'MPI': r'mpi\.h',
    'stb': r'stb/',
    'oneDNN': r'(oneapi/)?dnnl/|dnnl\w*\.h|omp\.h',  # OpenMP runs its loops, and is held there
    'Google Benchmark': r'benchmark/',
}
# A format's library is known to the files of that format only (benchmarks may measure against some).
FORMAT_FILES = {'OpenVDB': r'native/(io/media/volume_|package/parts/volume_|bench/)',
                'tinygltf': r'native/io/media/gltf_',
                'OpenImageIO': r'native/(io/media/image_|bench/)', 'zlib': r'native/io/media/packing/zlib_',
                'zstd': r'native/io/media/packing/zstd_', 'libwebp': r'native/io/media/(decoders|packing)/webp_',
                'libpng': r'native/io/media/decoders/png_', 'libjpeg': r'native/io/media/decoders/jpeg_',
                'OpenEXR': r'native/io/media/decoders/exr_',
                'oneDNN': r'native/nn/onednn/'}

# Headers of ours whose purpose is to hand a package's types to every folder.
CARRIERS = {'math/vec.h': {'Eigen'}}

# C headers with a '.h' in their name; C++'s own have none.
SYSTEM_HEADERS = re.compile(r'(stdint|stddef|errno|locale|fenv|xmmintrin)\.h|[a-z_0-9]+')
# What systems have each of their own stands in the folders that are built for one of them alone, and with what never
# leaves Linux.
PLATFORM_HEADERS = {
    r'native/(\w+/platform/posix|mpi|bench|package)/':
        re.compile(r'(strings|stdlib|time|dlfcn|unistd|fcntl|pthread|signal|execinfo)\.h'
                   r'|(sys/(file|random|stat|mman|types|resource|wait|statvfs|ioctl)|mach-o/dyld)\.h'),
    r'native/\w+/platform/windows/':
        re.compile(r'(windows|shellapi|io|fcntl|malloc|signal|dirent|wchar|sys/stat)\.h'),
}

SOURCE_EXTENSIONS = ('.cpp', '.h', '.c', '.py', '.sh', '.cmake', 'CMakeLists.txt')
LINE_LIMIT = 600
PROSE_WIDTH = 120  # characters of a line of documentation, and of Python
FILE_LIMIT = 40  # of one folder
LONGER_ALLOWED = {'native/include/stipple/stipple.h'}  # one public header: it is the manual

# Everything that only exists inside Blender.
BLENDER_MODULES = {'bpy', 'bpy_extras', 'bpy_types', 'mathutils', 'gpu', 'gpu_extras', 'bgl', 'blf', 'bmesh',
                   'bl_ui', 'bl_operators', 'rna_prop_ui', 'addon_utils', 'freestyle', 'idprop', 'imbuf', 'aud'}

# What libstipple.so may ask of the machine, so that one file loads into every Blender.
ALLOWED_NEEDED = re.compile(r'(libc|libm|libstdc\+\+|libgcc_s|libtbb|libhwy|ld-linux-[a-z0-9-]+)\.so(\.\d+)*')


def project_files(root):
    """Paths under root that belong to the project: what git has or would add; without git, everything."""
    root = pathlib.Path(root)
    listing = subprocess.run(['git', '-C', str(root), 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
                             capture_output=True)
    toplevel = subprocess.run(['git', '-C', str(root), 'rev-parse', '--show-toplevel'], capture_output=True, text=True)
    if listing.returncode == 0 and toplevel.stdout.strip() == str(root.resolve()):
        names = [os.fsdecode(name) for name in listing.stdout.split(b'\0') if name]
        return sorted({name for name in names if (root / name).is_file()})
    return sorted(str(path.relative_to(root)) for path in root.rglob('*') if path.is_file())


def top_level_violations(root):
    entries = {name.split('/')[0] for name in project_files(root)}
    return [f'{entry}: not one of the top-level entries' for entry in sorted(entries - TOP_LEVEL)]


def include_table(architecture):
    """The table of docs/architecture.md: folder -> (folders it may include, packages it may include)."""
    table = {}
    for line in pathlib.Path(architecture).read_text(encoding='utf-8').splitlines():
        cells = [cell.strip() for cell in line.split('|')[1:-1]]
        if len(cells) != 4 or not re.fullmatch(r'`[a-z]+`', cells[0]):
            continue
        folders = re.findall(r'`([a-z./]+)`', cells[2])
        packages = [name.strip() for name in cells[3].split(',') if name.strip()]
        unknown = set(packages) - set(THIRD_PARTY)
        if unknown:
            raise ValueError(f'the include table names unknown packages: {sorted(unknown)}')
        table[cells[0].strip('`')] = (set(folders), set(packages))
    return table


def includes(path):
    """(line number, included path) of every #include of a file."""
    text = path.read_text(encoding='utf-8', errors='replace')
    for number, line in enumerate(text.splitlines(), 1):
        match = re.match(r'\s*#\s*include\s+[<"]([^>"]+)[>"]', line)
        if match:
            yield number, match.group(1)


def package_of(included):
    return next((name for name, pattern in THIRD_PARTY.items() if re.match(pattern, included)), None)


def include_violations(root, table):
    """Includes of native/ that the table does not allow, and third-party headers that leave their folder."""
    root = pathlib.Path(root)
    found = []
    third_party_headers = {}  # header of ours -> third-party packages in it
    included_by = {}  # header of ours -> folders that include it
    for name in project_files(root):
        parts = name.split('/')
        if parts[0] != 'native' or len(parts) < 3 or not name.endswith(('.cpp', '.h', '.c')):
            continue
        folder = parts[1]
        if folder not in table:
            found.append(f'{name}: native/{folder} is not in the table')
            continue
        folders, packages = table[folder]
        for line, included in includes(root / name):
            where = f'{name}:{line}: {included}'
            package = package_of(included)
            target = included.split('/')[0]
            if package:
                if name.endswith('.h'):
                    third_party_headers.setdefault(included_name(name), set()).add(package)
                if package not in packages:
                    found.append(f'{where}: {folder} may not include {package}')
                elif not re.match(FORMAT_FILES.get(package, ''), name):
                    found.append(f'{where}: {package} belongs in the files of its format')
            elif included == 'stipple/stipple.h':
                if folder != 'include' and 'stipple.h' not in folders:
                    found.append(f'{where}: {folder} may not include the public header')
            elif target in table and '/' in included:
                included_by.setdefault(included, set()).add(folder)
                if target != folder and target not in folders:
                    found.append(f'{where}: {folder} may not include {target}')
            elif not SYSTEM_HEADERS.fullmatch(included) and not any(
                    re.match(place, name) and known.fullmatch(included) for place, known in PLATFORM_HEADERS.items()):
                found.append(f'{where}: neither ours, nor in the table, nor a known system header')
    for header, packages in sorted(third_party_headers.items()):
        outside = sorted(included_by.get(header, set()) - {header.split('/')[0]})
        if outside and packages - CARRIERS.get(header, set()):
            found.append(f'{header}: carries {sorted(packages)} into {outside}')
    return found


def included_name(name):
    return name.removeprefix('native/').removeprefix('include/')


def link_violations(cmake_lists, table):
    """stipple_module(...) lines of native/CMakeLists.txt that link more than the table allows."""
    found = []
    text = pathlib.Path(cmake_lists).read_text(encoding='utf-8')
    for name, arguments in re.findall(r'^stipple_module\((\w+)([^)]*)\)', text, re.M):
        modules = re.search(r'\bMODULES\s+((?:[a-z]+\s*)+)', arguments)
        linked = set(modules.group(1).split()) if modules else set()
        if name not in table:
            found.append(f'stipple_{name} is not in the table')
        elif linked - table[name][0]:
            found.append(f'stipple_{name} links {sorted(linked - table[name][0])}, which the table does not allow')
    return found


def blender_import_violations(folder):
    """Imports of Blender's modules in the Python files of a folder, at any depth of the code."""
    found = []
    for path in sorted(pathlib.Path(folder).rglob('*.py')):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'), str(path))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                names = [node.module or '']
            elif isinstance(node, ast.Call) and getattr(node.func, 'id', getattr(node.func, 'attr', '')) in (
                    '__import__', 'import_module'):
                names = [argument.value for argument in node.args[:1] if isinstance(argument, ast.Constant)]
            found += [f'{path}:{node.lineno}: imports {name}' for name in names
                      if str(name).split('.')[0] in BLENDER_MODULES]
    return found


def length_violations(root):
    found = []
    for name in project_files(root):
        if name.endswith(SOURCE_EXTENSIONS) and name not in LONGER_ALLOWED:
            lines = (pathlib.Path(root) / name).read_bytes().count(b'\n')
            if lines > LINE_LIMIT:
                found.append(f'{name}: {lines} lines, at most {LINE_LIMIT} are allowed')
    return found


def crowded_folders(root):
    """Folders of the libraries and the add-on in which more files lie side by side than one can take in."""
    counts = collections.Counter(os.path.dirname(name) for name in project_files(root)
                                 if name.startswith(('native/', 'addon/')))
    return [f'{folder}: {count} files, at most {FILE_LIMIT} are allowed' for folder, count in sorted(counts.items())
            if count > FILE_LIMIT]


# Errors, handles and jobs: what every exported function stands on.
BOUNDARY_MACHINERY = {'errors.cpp', 'guard.h', 'handles.h', 'job.cpp', 'job.h'}
FUNCTION_LIMIT = 40  # lines of a function of native/api
# What a conversion has no use for: it measures no time, draws no numbers and sorts nothing.
NO_CONVERSION_INCLUDES = {'chrono', 'numeric', 'random', 'execution'}
NO_CONVERSION_CALLS = re.compile(r'\b(parallelFor|parallelSum|sort|stable_sort|nth_element|partial_sort|accumulate|'
                                 r'reduce|transform|inner_product|count_if|min_element|max_element)\s*[(<]')
# What the signature of a conversion has: a type of the header, a raw pointer to numbers, or the name of the caller's
# argument. A check of an argument, require… or fail…, may have neither.
C_SIGNATURE = re.compile(r'\bStipple[A-Z]\w*|\b(float|double|uint8_t|uint32_t|uint64_t|T|To)\s*\*|\bconst '
                         r'char\s*\*\s*name\b')
# Of things that come by the thousand. Instances, views, levels, rows and formats come by the dozen.
MANY_THINGS = re.compile(r'splat|pixel|voxel|vert|triangle|anchor|point|brick|density|position|width|height|rgba', re.I)


def without_comments(text):
    """The code of a C++ file at its own lines: comments, texts and preprocessor lines are blanked."""
    def blank(match):
        return re.sub(r'[^\n]', ' ', match.group(0))
    text = re.sub(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'', blank, text, flags=re.S)
    return re.sub(r'^[ \t]*#(?:[^\n]*\\\n)*[^\n]*', blank, text, flags=re.M)


def functions_of(text):
    """(head, body, line of the head) of every function that a C++ file defines, members of its types too."""
    code = without_comments(text).replace('extern        {', 'extern "C"{')  # a blanked text has its quotes blanked too
    found, at, begin = [], 0, 0
    while at < len(code):
        if code[at] == '{':
            head = re.sub(r'\b(public|private|protected)\s*:', ' ', code[begin:at])
            is_type = re.search(r'^\s*(template\s*<[^{}]*>\s*)?(struct|class|union)\b[^()]*$', head)
            if not is_type and not re.search(r'\bnamespace\b[^()]*$|\bextern\s*(""|"C")?\s*$', head):
                end = _closing(code, at)
                if '(' in head and not re.search(r'=\s*$', head):
                    start = begin + len(code[begin:at]) - len(code[begin:at].lstrip())
                    found.append((head.strip(), code[at:end], code.count('\n', 0, start) + 1))
                at = end
            begin = at + 1
        elif code[at] in ';}':
            begin = at + 1
        at += 1
    return found


def _closing(code, at):
    """The place behind the brace that closes the one at `at`."""
    depth = 0
    for place in range(at, len(code)):
        depth += {'{': 1, '}': -1}.get(code[place], 0)
        if depth == 0:
            return place + 1
    return len(code)


def _loop_heads(body):
    """What stands in the brackets of every `for` and `while`."""
    for match in re.finditer(r'\b(for|while)\s*\(', body):
        depth, place = 1, match.end()
        while depth and place < len(body):
            depth += {'(': 1, ')': -1}.get(body[place], 0)
            place += 1
        yield body[match.end():place - 1]


def _what_is_wrong(head, body, is_machinery):
    """Why a function of native/api is no marshalling, as sentences."""
    name = re.search(r'([~\w]+)\s*\(', re.sub(r'\[\[.*?\]\]|template\s*<[^{}]*?>(?=\s)', ' ', head))
    name = name.group(1) if name else head
    is_exported = name.startswith('stipple_')
    is_conversion = C_SIGNATURE.search(head) or re.match(r'(require|fail)[A-Z]', name)
    if not (is_exported or is_conversion or is_machinery):
        yield f'{name} is neither an exported function nor a conversion'
    lines = (head + body).count('\n') + 1
    if lines > FUNCTION_LIMIT:
        yield f'{name} has {lines} lines, at most {FUNCTION_LIMIT} are allowed'
    loops = list(_loop_heads(body))
    if is_exported and loops:
        yield f'{name} is exported and has a loop'
    yield from (f'{name} has a loop over {loop.strip()}' for loop in loops if not is_exported
                and MANY_THINGS.search(loop))
    call = NO_CONVERSION_CALLS.search(body)
    if call:
        yield f'{name} calls {call.group(1)}'


def boundary_violations(root):
    """What of native/api is not marshalling."""
    found = []
    for name in project_files(root):
        folder, _, file = name.rpartition('/')
        if not (folder + '/').startswith('native/api/') or not file.endswith(('.cpp', '.h')):
            continue
        path = pathlib.Path(root) / name
        found += [f'{name}:{line}: {included}: a conversion has no use for it' for line, included in includes(path)
                  if included in NO_CONVERSION_INCLUDES]
        for head, body, line in functions_of(path.read_text(encoding='utf-8')):
            found += [f'{name}:{line}: {reason}' for reason in _what_is_wrong(head, body, file in BOUNDARY_MACHINERY)]
    return found


def c99_violations(header, scratch):
    """What a C99 compiler says about a header that is included on its own."""
    source = pathlib.Path(scratch) / 'only_the_header.c'
    source.write_text(f'#include "{pathlib.Path(header).resolve()}"\nint main(void) {{ return 0; }}\n',
                      encoding='utf-8')
    compiler = subprocess.run([os.environ.get('CC', 'cc'), '-std=c99', '-pedantic-errors', '-Wall', '-Wextra',
                               '-Werror', '-fsyntax-only', str(source)], capture_output=True, text=True)
    return compiler.stderr.splitlines() if compiler.returncode else []


def needed(library):
    """Names of the libraries that a library or a program is linked with."""
    listing = subprocess.run(['readelf', '-d', '-W', str(library)], capture_output=True, text=True, check=True).stdout
    return re.findall(r'\(NEEDED\).*\[(.+)\]', listing)


def needed_violations(library):
    return [f'{library} needs {name}' for name in needed(library) if not ALLOWED_NEEDED.fullmatch(name)]


def mpi_violations(library):
    """MPI is for a program of its own: what it needs of a machine would be asked of every Blender."""
    return [f'{library} needs {name}' for name in needed(library) if re.match(r'lib(mpi|mpich|open-rte|open-pal)\b',
                                                                              name)]


def exported_symbols(library):
    listing = subprocess.run(['nm', '-D', '--defined-only', '--format=posix', str(library)],
                             capture_output=True, text=True, check=True).stdout
    return {line.split()[0].split('@')[0] for line in listing.splitlines() if line.split()[1:2] != ['A']}


def export_violations(library):
    return [f'{library} exports {name}' for name in sorted(exported_symbols(library))
            if not name.startswith('stipple_')]


def declared_functions(header):
    """Names of the functions that the public header declares."""
    text = re.sub(r'/\*.*?\*/', '', pathlib.Path(header).read_text(encoding='utf-8'), flags=re.S)
    return set(re.findall(r'^\s*[A-Za-z][\w\s*]*?\b(stipple_\w+)\s*\(', text, re.M))


def missing_exports(header, library):
    exported = exported_symbols(library)
    return [f'{name} is declared in {header} and not exported by {library}'
            for name in sorted(declared_functions(header)) if name not in exported]


def broken_links(root):
    """Relative links in Markdown pages to files that are not there."""
    found = []
    for name in project_files(root):
        if name.endswith('.md'):
            page = pathlib.Path(root) / name
            for target in re.findall(r'\]\(([^)\s]+)\)', page.read_text(encoding='utf-8')):
                file = target.split('#')[0]
                if file and '://' not in target and not (page.parent / file).exists():
                    found.append(f'{name}: {target}')
    return found


def wide_prose(root):
    """Lines of documentation that are wider than a window; tables and single words cannot be broken."""
    found = []
    for name in project_files(root):
        if name.endswith('README.md') or name.startswith('docs/') and name.endswith('.md'):
            for number, line in enumerate((pathlib.Path(root) / name).read_text(encoding='utf-8').splitlines(), 1):
                if len(line) > PROSE_WIDTH and not line.lstrip().startswith('|') and len(line.split()) > 1:
                    found.append(f'{name}:{number}: {len(line)} characters, at most {PROSE_WIDTH} are allowed')
    return found


def wide_python(root):
    """Lines of the add-on and the tests that are wider than a window."""
    found = []
    for name in project_files(root):
        if name.startswith(('addon/', 'tests/')) and name.endswith('.py'):
            for number, line in enumerate((pathlib.Path(root) / name).read_text(encoding='utf-8').splitlines(), 1):
                if len(line) > PROSE_WIDTH:
                    found.append(f'{name}:{number}: {len(line)} characters, at most {PROSE_WIDTH} are allowed')
    return found
