#!/usr/bin/env bash
# Prints how many compilers may run at a time: one per core, and one per 2 GiB of memory, which is what
# a file that includes OpenVDB's headers takes.
set -euo pipefail
cores=$(nproc)
memory=$(awk '/^MemAvailable:/ {print int($2 / (2 * 1024 * 1024))}' /proc/meminfo)
jobs=$((cores < memory ? cores : memory))
echo $((jobs > 1 ? jobs : 1))
