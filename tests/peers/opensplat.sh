#!/usr/bin/env bash
# Times a training step of OpenSplat beside ours, on the same points, pictures and machine. See README.md here.
#   OPENSPLAT_SOURCE=folder bash tests/peers/opensplat.sh
# STIPPLE_BUILD_DIR: our build (default build/release). OPENSPLAT_BUILD_DIR: where the peer is built (default
# build/peers/opensplat). Exit 77: something is missing, and which.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/build_opensplat.sh"
step_program=$build/tests/training_step
[[ -x $step_program ]] || missing "$step_program is not built; cmake --build $build --target training_step stipple stipple_media"
build_opensplat

scene=$peer_build/scene
STIPPLE_LIBRARY=$build/lib/libstipple.so /usr/bin/python3 "$root/tests/peers/make_scene.py" "$scene"
exec /usr/bin/python3 "$root/tests/peers/time_steps.py" "$peer_build/opensplat" "$step_program" "$scene"
