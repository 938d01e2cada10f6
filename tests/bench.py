"""Runs the benchmarks that have limits and says which miss them.

    python3 tests/bench.py PROGRAM [LIMITS] [--only REGEX]

PROGRAM is stipple_bench, LIMITS native/bench/limits.txt. Exits with 1 where a ratio misses its limit, and where a limit
has no ratio: a benchmark that is renamed takes its guard along. A benchmark that says why it cannot run here, such as
on a processor without an instruction set, is shown and counts as neither."""
import argparse
import fnmatch
import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

LIMITS = Path(__file__).resolve().parents[1] / 'native' / 'bench' / 'limits.txt'
ROW = re.compile(r'(?P<benchmark>\S+)\s+(?P<against>\S+)\s+(?P<sign><=|>=)\s+(?P<bound>[0-9.]+)(?:\s+(?P<why>.*))?$')


@dataclass(frozen=True)
class Limit:
    benchmark: str  # with * for anything
    against: str
    sign: str
    bound: float

    def holds(self, ratio):
        return ratio <= self.bound if self.sign == '<=' else ratio >= self.bound


def read_limits(path):
    limits = []
    for number, line in enumerate(Path(path).read_text(encoding='utf-8').splitlines(), 1):
        if not line.strip() or line.startswith('#'):
            continue
        row = ROW.match(line)
        if row is None:
            sys.exit(f'{path}, line {number}: "benchmark against <= bound" is expected, not "{line}"')
        limits.append(Limit(row['benchmark'], row['against'], row['sign'], float(row['bound'])))
    return limits


def measured(program, limits, only):
    """Runs the benchmarks of the limits: [Google Benchmark's rows]."""
    names = subprocess.run([program, '--benchmark_list_tests'], capture_output=True, text=True,
                           check=True).stdout.split()
    # Google Benchmark appends what it was told of iterations and clocks: "name/iterations:3/manual_time".
    wanted = [name for name in names if any(fnmatch.fnmatchcase(name.split('/')[0], limit.benchmark)
                                            for limit in limits)
              and (not only or re.search(only, name))]
    if not wanted:
        return []
    pattern = '^(' + '|'.join(map(re.escape, wanted)) + ')$'
    result = subprocess.run([program, f'--benchmark_filter={pattern}', '--benchmark_format=json'],
                            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    if result.returncode != 0:
        sys.exit(f'{program} ended with {result.returncode}')
    return json.loads(result.stdout)['benchmarks']


def judged(limits, rows, only):
    """[(benchmark, against, ratio or None, limit, verdict)]: ok, MISS, or why there is no ratio."""
    found = []
    for limit in limits:
        matched = False
        for row in rows:
            name = row['name'].split('/')[0]
            if not fnmatch.fnmatchcase(name, limit.benchmark):
                continue
            if row.get('error_occurred'):
                found.append((name, limit.against, None, limit, row['error_message']))
                matched = True
            for key, ratio in row.items():
                if not key.startswith('ratio_') or not fnmatch.fnmatchcase(key[len('ratio_'):], limit.against):
                    continue
                matched = True
                found.append((name, key[len('ratio_'):], ratio, limit, 'ok' if limit.holds(ratio) else 'MISS'))
        if not matched and not only:
            found.append((limit.benchmark, limit.against, None, limit, 'MISS: nothing measured it'))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('program')
    parser.add_argument('limits', nargs='?', default=LIMITS)
    parser.add_argument('--only', help='benchmarks whose names match')
    arguments = parser.parse_args()
    limits = read_limits(arguments.limits)
    verdicts = judged(limits, measured(arguments.program, limits, arguments.only), arguments.only)
    print(f'{"benchmark":<46} {"against":<20} {"ratio":>8}  {"limit":<8} verdict')
    for name, against, ratio, limit, verdict in verdicts:
        shown = '' if ratio is None else f'{ratio:.3g}'
        print(f'{name:<46} {against:<20} {shown:>8}  {limit.sign} {limit.bound:<5g} {verdict}')
    missed = sum(verdict.startswith('MISS') for *_, verdict in verdicts)
    print(f'{len(verdicts)} ratios, {missed} missed')
    sys.exit(1 if missed or not verdicts else 0)


if __name__ == '__main__':
    main()
