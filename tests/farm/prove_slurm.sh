#!/usr/bin/env bash
# Proves collect_array.sh with a real Slurm: one node, this machine, of a temporary folder, and an array of two tasks
# over four small meshes. As root, with Debian's Slurm (apt-get install --no-install-recommends slurmctld slurmd
# slurm-client munge), Blender and a built library. Installs nothing, needs no network, and ends what it has started.
#   bash tests/farm/prove_slurm.sh
# STIPPLE_BUILD_DIR: where the library is built, else build/release. Exit 77: something is missing, and which.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
library=${STIPPLE_LIBRARY:-${STIPPLE_BUILD_DIR:-$root/build/release}/lib/libstipple.so}
missing() { echo "Skipped: $1"; exit 77; }
for program in slurmctld slurmd sbatch squeue munged mungekey blender; do
  command -v "$program" > /dev/null || missing "$program is not installed"
done
[[ $(id -u) == 0 ]] || missing "slurmd needs root"
[[ -f $library ]] || missing "$library is not built"

work=$(mktemp -d "${TMPDIR:-/tmp}/stipple-slurm-XXXXXX")
started=()
finish() {
  local code=$?
  for process in "${started[@]}"; do kill "$process" 2> /dev/null || true; done
  wait || true
  if [[ $code == 0 ]]; then rm -rf "$work"; else echo "Failed; logs are in $work"; fi
  exit "$code"
}
trap finish EXIT

# Four cubes, two of them in a folder of their own.
mkdir -p "$work/assets/more" "$work/state" "$work/spool"
cube() {
  printf 'v 0 0 0\nv 0 0 1\nv 0 1 0\nv 0 1 1\nv 1 0 0\nv 1 0 1\nv 1 1 0\nv 1 1 1\n'
  printf 'f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n'
}
for name in a b more/c more/d; do cube > "$work/assets/$name.obj"; done

host=$(hostname -s)
memory=$(awk '/^MemTotal/ {print int($2 / 1024 / 2)}' /proc/meminfo)
cat > "$work/slurm.conf" <<EOF
ClusterName=proof
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge.socket
CryptoType=crypto/munge
SlurmctldPort=26817
SlurmdPort=26818
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
NodeName=$host NodeAddr=127.0.0.1 CPUs=$(nproc) RealMemory=$memory State=UNKNOWN
PartitionName=proof Nodes=$host Default=YES MaxTime=10:00 State=UP
EOF
export SLURM_CONF=$work/slurm.conf
chmod 755 "$work"

mungekey --create --keyfile "$work/munge.key"
munged --foreground --force --socket "$work/munge.socket" --key-file "$work/munge.key" --pid-file "$work/munge.pid" \
  --seed-file "$work/munge.seed" --log-file "$work/munge.log" > "$work/munged.out" 2>&1 &
started+=($!)
slurmctld -D > "$work/slurmctld.out" 2>&1 &
started+=($!)
slurmd -D > "$work/slurmd.out" 2>&1 &
started+=($!)

for _ in $(seq 60); do
  state=$(sinfo --noheader --format=%T 2> /dev/null || true)
  [[ $state == idle* ]] && break
  sleep 1
done
[[ $state == idle* ]] || { echo "The node is '$state' after a minute"; tail -n 5 "$work"/*.log "$work"/*.out; exit 1; }
echo "Slurm $(slurmctld -V | awk '{print $2}') runs: $(sinfo --noheader --format='node %n is %T, %c processors')"

cd "$work"
export STIPPLE_ROOT=$root STIPPLE_LIBRARY=$library PATH=/usr/bin:$PATH
begun=$SECONDS
job=$(sbatch --parsable --array=0-1 --cpus-per-task=1 --export=ALL "$root/tests/farm/collect_array.sh" \
  "$work/assets" "$work/out" --views 8 --size 64 --samples 4 --points 1000)
echo "Submitted array $job of two tasks over four meshes"
for _ in $(seq 300); do
  left=$(squeue --noheader --array --jobs="$job" --states=all --format=%T 2> /dev/null |
    grep -Evc 'COMPLETED|FAILED' || true)
  [[ $left == 0 ]] && break
  sleep 1
done
cat collect-"$job"-*.log | grep -v Blender || true
for name in a b more_c more_d; do
  for file in transforms.json points.ply images/0007.png; do
    [[ -f $work/out/$name/$file ]] || { echo "$name has no $file"; exit 1; }
  done
done
for task in 0 1; do
  count=$(grep -c ': done, ' "collect-$job-$task.log" || true)
  [[ $count == 2 ]] || { echo "Task $task has done $count meshes; two were meant for it"; exit 1; }
done
echo "All four meshes are collected, two by each task, $((SECONDS - begun)) s after they were submitted"
