#!/bin/bash
# test_verify_tiles_kinds.sh - the judges of 3D Tiles and of Terrarium on a small terrain, and on spoiled ones (tests/test_verify_tiles_kinds.py). Ends with `N passed, N failed`.
set -u
cd "$(dirname "$0")/.." || exit 1
export RQT=${RQT:-$PWD/build/rqt} RQT_SO=${RQT_SO:-$PWD/build/rqt.so} PYTHONDONTWRITEBYTECODE=1
exec "${PYTHON:-/usr/bin/python3}" tests/test_verify_tiles_kinds.py
