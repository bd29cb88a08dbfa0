#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Install the programs that tests/peers/run.sh holds Gonio's files against, as far as Debian and npm have them: Blender, Chromium, Node.js, and under
# BUILD/peers Khronos' glTF validator and three.js. Nothing of them is part of Gonio. A mirror that fails or hangs costs at most LIMIT seconds (600)
# each and is said; the tests then say SKIP.
# usage: tools/peers.sh BUILD_FOLDER
set -u
build=$1 limit=${LIMIT:-600}
for program in blender chromium npm; do
    command -v $program >/dev/null || timeout "$limit" tools/deps.sh $program || echo "peers: Debian's $program could not be installed" >&2
done
timeout "$limit" tools/deps.sh python3-numpy || echo "peers: python3-numpy, of Blender's glTF importer, could not be installed" >&2
command -v npm >/dev/null || exit 0
mkdir -p "$build/peers"
[ -d "$build/peers/node_modules/gltf-validator" ] && [ -d "$build/peers/node_modules/three" ] && exit 0
timeout "$limit" npm install --silent --no-audit --no-fund --no-save --prefix "$build/peers" gltf-validator@2.0.0-dev.3.10 three@0.187.0 ||
    echo "peers: npm's packages could not be installed" >&2
exit 0
