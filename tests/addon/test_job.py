# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs tell how long they took, contexts how much memory they allow."""

import time

import numpy as np

from stipple.binding.cloud import Cloud, SplatArrays
from stipple.binding.context import Context
from stipple.binding.model import Model


def cloud_of(context, count):
    numbers = np.random.default_rng(3)
    return Cloud.create(context, SplatArrays(
        numbers.random((count, 3), np.float32), np.tile(np.float32([1, 0, 0, 0]), (count, 1)),
        np.full((count, 3), 0.01, np.float32), np.full(count, 0.5, np.float32), np.zeros((count, 1, 3), np.float32)))


def test_a_job_tells_its_seconds_until_its_end(context):
    begin = time.perf_counter()
    job = Model.from_cloud_start(context, cloud_of(context, 20_000))
    early = job.seconds()
    job.wait()
    passed = time.perf_counter() - begin
    seconds = job.seconds()
    assert 0 <= early <= seconds <= passed and seconds > 0
    time.sleep(0.01)
    assert job.seconds() == seconds  # it has ended


def test_a_context_tells_its_memory_limit(library):
    assert Context(library, memory_limit_bytes=123 << 20).memory_limit() == 123 << 20
    with open('/proc/meminfo') as file:
        total = int(file.readline().split()[1]) * 1024
    assert Context(library).memory_limit() <= total
