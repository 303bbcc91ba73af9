#!/bin/bash
# Installs the Debian packages named as arguments, where they are missing; says in one line what to do elsewhere.
set -euo pipefail

if ! command -v cargo > /dev/null; then
    echo "setup: cargo is missing: install Rust 1.89 or later with rustup (https://rustup.rs), then run make again" >&2
    exit 1
fi
missing=()
for package in "$@"; do
    case $package in
        # What else provides these will do.
        gcc) command -v cc > /dev/null || missing+=("$package") ;;
        curl | jq | pkg-config) command -v "$package" > /dev/null || missing+=("$package") ;;
        nodejs) command -v node > /dev/null || missing+=("$package") ;;
        npm) command -v npm > /dev/null || missing+=("$package") ;;
        python3-venv) python3 -c 'import ensurepip, venv' 2> /dev/null || missing+=("$package") ;;
        libhdf5-dev) pkg-config --exists hdf5 2> /dev/null || pkg-config --exists hdf5-serial 2> /dev/null || missing+=("$package") ;;
        ca-certificates) [ -e /etc/ssl/certs/ca-certificates.crt ] || missing+=("$package") ;;
        *) dpkg -s "$package" > /dev/null 2>&1 || missing+=("$package") ;;
    esac
done
[ ${#missing[@]} -eq 0 ] && exit 0

if ! command -v apt-get > /dev/null; then
    echo "setup: install these, or what your system calls them, then run make again: ${missing[*]}" >&2
    exit 1
fi
as_root=()
if [ "$(id -u)" -ne 0 ]; then
    if ! command -v sudo > /dev/null; then
        echo "setup: run as root: apt-get install ${missing[*]}" >&2
        exit 1
    fi
    as_root=(sudo)
fi
echo "setup: installing ${missing[*]}"
"${as_root[@]}" apt-get update -qq
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" > /dev/null
