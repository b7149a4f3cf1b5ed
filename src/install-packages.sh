#!/bin/sh
# install-packages.sh PURPOSE... - installs the Debian packages that a purpose needs and this machine lacks, saying which.
#
# Purposes: build, web (the viewer's bundle), browser (which the tests see it in), test, format, fuzz, lint, bench, peers, views (ETOPO5, and pictures of
# views), qgis (650 MB). Does nothing, silently, when all is there. Needs root or sudo only when something is missing. On another system it says what to install by hand.
set -eu

packages_for() {
    case $1 in
    build) echo gcc g++ libc6-dev make pkg-config sqlite3 libsqlite3-dev libzstd-dev libgdal-dev libgeographiclib-dev \
        libgeos-dev libproj-dev proj-data libcjson-dev libcairo2-dev libpng-dev fonts-dejavu-core gnuplot-nox libmicrohttpd-dev libdeflate-dev zlib1g-dev ;;
    test) echo libcmocka-dev libgmp-dev gdal-bin libsqlite3-mod-spatialite python3 python3-gdal python3-numpy unzip binutils git ;;
    format) echo clang-format ;;
    qgis) echo python3-qgis ;;
    fuzz) echo clang-14 libclang-rt-14-dev ;;
    lint) echo clang-tidy-14 cppcheck ;;
    bench) echo wrk nginx-light curl python3 util-linux ;;
    browser) echo chromium fonts-dejavu-core ;;
    views) echo ferret-datasets python3-pil ;;
    web | peers) command -v node >/dev/null 2>&1 && command -v npm >/dev/null 2>&1 || echo nodejs npm ;;
    *) echo "install-packages.sh: unknown purpose $1" >&2; exit 2 ;;
    esac
}

if ! command -v dpkg-query >/dev/null 2>&1; then
    command -v gdal-config >/dev/null 2>&1 && exit 0
    echo "This is no Debian: please install the equivalents of" >&2
    for purpose in "$@"; do packages_for "$purpose" >&2; done
    exit 1
fi

missing=
for purpose in "$@"; do
    for package in $(packages_for "$purpose"); do
        status=$(dpkg-query -W -f='${Status}' "$package" 2>/dev/null || true)
        case $status in *"ok installed") ;; *) missing="$missing $package" ;; esac
    done
done
[ -n "$missing" ] || exit 0

run=
if [ "$(id -u)" != 0 ]; then
    command -v sudo >/dev/null 2>&1 || { echo "Please install these packages as root:$missing" >&2; exit 1; }
    run=sudo
fi
echo "Installing what is missing:$missing" >&2
log=$(mktemp)
trap 'rm -f "$log"' EXIT
export DEBIAN_FRONTEND=noninteractive
install() {
    # shellcheck disable=SC2086
    $run apt-get install -y --no-install-recommends -o DPkg::Lock::Timeout=400 $missing >"$log" 2>&1
}
# The package lists may be missing or old: fetch them when the first try fails.
if ! install; then
    $run apt-get update -qq >"$log" 2>&1 || true
    install || { cat "$log" >&2; echo "apt-get could not install:$missing" >&2; exit 1; }
fi
