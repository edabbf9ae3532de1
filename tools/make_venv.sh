#!/usr/bin/env bash
# Make the virtual environment. Debian keeps venv's pip in a package of its own; as root it is installed, else it is named.
set -euo pipefail
python=${PYTHON:-python3}
venv=${VENV:-.venv}

if ! "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))'; then
    echo "taxel needs Python 3.11 or newer; $python is $("$python" --version 2>&1)" >&2
    exit 1
fi
if ! "$python" -c 'import venv, ensurepip' 2>/dev/null; then
    if [ "$(id -u)" -eq 0 ] && command -v apt-get >/dev/null; then
        echo "installing python3-venv"
        (apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq python3-venv) >/dev/null
    else
        echo "Python's venv module is incomplete: install it first (Debian: apt-get install python3-venv)" >&2
        exit 1
    fi
fi
echo "making the virtual environment $venv"
"$python" -m venv "$venv"
