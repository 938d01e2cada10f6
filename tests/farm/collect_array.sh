#!/usr/bin/env bash
# Collects a folder of meshes for training on a farm: a Slurm job array whose tasks each take a part of the files.
#   sbatch --array=0-7 --cpus-per-task=4 tests/farm/collect_array.sh ASSETS OUT [--views 150 --size 512 ...]
# The array counts from 0. Whatever a task had finished before it was stopped, the next one passes over.
# STIPPLE_ROOT: this project, else the folder that sbatch was called in. STIPPLE_LIBRARY: libstipple.so, else the one in
# build/release/lib. STIPPLE_BLENDER: Blender, else that of PATH.
#SBATCH --job-name=stipple-collect
#SBATCH --output=collect-%A-%a.log
set -euo pipefail
root=${STIPPLE_ROOT:-$PWD}
script=$root/addon/collect_for_training.py
if [[ ! -f $script ]]; then
  echo "$script is missing; call sbatch in the project's folder, or set STIPPLE_ROOT to it" >&2
  exit 2
fi
if [[ -z ${SLURM_ARRAY_TASK_ID:-} || ${SLURM_ARRAY_TASK_MIN:-0} != 0 ]]; then
  echo "A job array is needed that counts from 0: sbatch --array=0-7 $0 ASSETS OUT" >&2
  exit 2
fi
# Blender sees the processors of the whole machine, and not those that Slurm has given it.
exec "${STIPPLE_BLENDER:-blender}" -b --factory-startup --python-exit-code 1 -t "${SLURM_CPUS_PER_TASK:-1}" \
  -P "$script" -- "$@" --index "$SLURM_ARRAY_TASK_ID" --of "$SLURM_ARRAY_TASK_COUNT"
