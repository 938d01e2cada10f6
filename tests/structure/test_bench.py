"""tests/bench.py, run against a program that only says what a benchmark would."""
import json
import pathlib
import re
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
SCRIPT = ROOT / 'tests' / 'bench.py'
LIMITS = ROOT / 'native' / 'bench' / 'limits.txt'


@pytest.fixture
def bench(tmp_path):
    """run(rows, limits, *arguments): the script's result where the benchmarks say these rows."""
    def run(rows, limits, *arguments):
        program = tmp_path / 'stipple_bench'
        (tmp_path / 'limits.txt').write_text(limits)
        (tmp_path / 'out.json').write_text(json.dumps({'benchmarks': rows}))
        names = '\\n'.join(row['name'] for row in rows)
        program.write_text('#!/bin/sh\ncase "$1" in\n--benchmark_list_tests) printf "' + names + '\\n";;\n'
                           f'*) echo "$1" > {tmp_path}/filter; cat {tmp_path}/out.json;;\nesac\n')
        program.chmod(0o755)
        return subprocess.run([sys.executable, str(SCRIPT), str(program), str(tmp_path / 'limits.txt'), *arguments],
                              capture_output=True, text=True)
    return run


def test_the_program_is_where_the_command_looks_for_it():
    looked_for = re.search(r'tests/bench\.py (build/release/\S+)', (ROOT / 'tests' / 'run.sh').read_text())[1]
    program = ROOT / looked_for
    if not (ROOT / 'build' / 'release' / 'build.ninja').exists():
        pytest.skip('build/release is not built here')
    names = subprocess.run([program, '--benchmark_list_tests'], capture_output=True, text=True, check=True).stdout
    assert len(names.split()) > 100


FAST = {'name': 'io.read.1M/iterations:8/manual_time', 'ratio_fread': 0.7, 'best_ms': 3.0}
LIMIT = '# why\n\nio.read.*  fread  >= 0.6   as fast as one fread\n'


def test_a_ratio_within_its_limit_passes(bench, tmp_path):
    result = bench([FAST, {'name': 'other/manual_time', 'ratio_x': 9}], LIMIT)
    assert result.returncode == 0, result.stdout + result.stderr
    assert re.search(r'io\.read\.1M +fread +0\.7 +>= 0\.6 +ok', result.stdout)
    # Only what has a limit is run.
    assert (tmp_path / 'filter').read_text().strip() == '--benchmark_filter=^(io\\.read\\.1M/iterations:8/manual_time)$'


@pytest.mark.parametrize('sign, ratio', [('>=', 0.59), ('<=', 0.61)])
def test_a_miss_exits_with_an_error(bench, sign, ratio):
    result = bench([{**FAST, 'ratio_fread': ratio}], LIMIT.replace('>=', sign))
    assert result.returncode == 1 and 'MISS' in result.stdout and '1 missed' in result.stdout


def test_a_limit_that_nothing_measures_is_a_miss(bench):
    result = bench([FAST], LIMIT + 'io.renamed.* fread >= 0.6\n')
    assert result.returncode == 1 and 'nothing measured it' in result.stdout
    # ... unless only some were asked for.
    assert bench([FAST], LIMIT + 'io.renamed.* fread >= 0.6\n', '--only', 'read').returncode == 0
    assert bench([FAST], LIMIT, '--only', 'nothing').returncode == 1


def test_what_cannot_run_here_is_shown_and_does_not_fail(bench):
    row = {'name': 'io.read.2M', 'error_occurred': True, 'error_message': 'this processor has no such thing'}
    result = bench([FAST, row], LIMIT)
    assert result.returncode == 0 and 'this processor has no such thing' in result.stdout


def test_a_line_that_is_no_limit_is_refused(bench):
    result = bench([FAST], 'io.read.* fread 0.6\n')
    assert result.returncode == 1 and 'line 1' in result.stderr


def test_the_limits_name_ratios_of_the_benchmarks():
    sources = ''.join(path.read_text() for path in (ROOT / 'native' / 'bench').rglob('*_bench.cpp'))
    rows = [line.split() for line in LIMITS.read_text().splitlines() if line and not line.startswith('#')]
    assert len(rows) > 40
    assert len({tuple(row[:2]) for row in rows}) == len(rows)
    for benchmark, against, *_ in rows:
        assert against.lstrip('*') in sources, against
    # No limit stands anywhere else.
    assert not re.search(r'counters\["(limit|target)_', sources)
