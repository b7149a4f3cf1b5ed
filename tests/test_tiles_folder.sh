#!/bin/bash
# test_tiles_folder.sh - tiles for globes as files and of the service (tests/test_tiles_folder.py). Ends with `N passed, N failed`.
set -u
cd "$(dirname "$0")/.." || exit 1
export RQT=${RQT:-$PWD/build/rqt} RQT_SO=${RQT_SO:-$PWD/build/rqt.so} PYTHONDONTWRITEBYTECODE=1
exec "${PYTHON:-/usr/bin/python3}" tests/test_tiles_folder.py
