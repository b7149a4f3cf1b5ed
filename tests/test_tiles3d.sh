#!/bin/bash
# test_tiles3d.sh - 3D Tiles, read and measured (tests/test_tiles3d.py). Ends with `N passed, N failed`.
set -u
cd "$(dirname "$0")/.." || exit 1
export RQT=${RQT:-$PWD/build/rqt} RQT_SO=${RQT_SO:-$PWD/build/rqt.so} PYTHONDONTWRITEBYTECODE=1
exec "${PYTHON:-/usr/bin/python3}" tests/test_tiles3d.py
