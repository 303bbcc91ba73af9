#!/bin/bash
# Checks what is in this folder as far as this machine can: each tool that is there has its say, and what is not there is named.
set -uo pipefail
cd "$(dirname "$0")"
failed=0
say() { printf '%-28s %s\n' "$1" "$2"; }

if command -v systemd-analyze > /dev/null; then
    unit=$(mktemp -d)
    # The program need not be installed for the unit to be looked at.
    sed 's|/usr/local/bin/meniscus|/bin/true|' meniscus.service > "$unit/meniscus.service"
    if output=$(systemd-analyze verify "$unit/meniscus.service" 2>&1) && [ -z "$output" ]; then
        say "systemd unit" "verified"
    else
        say "systemd unit" "FAILED: $output"; failed=1
    fi
    exposure=$(systemd-analyze security --offline=true "$unit/meniscus.service" 2> /dev/null | tail -1)
    say "systemd exposure" "${exposure#*: }"
    rm -r "$unit"
else
    say "systemd unit" "not checked: systemd-analyze is not here"
fi
if docker info > /dev/null 2>&1; then
    if docker compose -f compose.yaml config -q; then say "compose file" "valid"; else say "compose file" "FAILED"; failed=1; fi
    if docker build -q -f Dockerfile .. > /dev/null; then say "image" "built"; else say "image" "FAILED"; failed=1; fi
else
    say "image" "not built: no docker daemon here"
    if python3 -c 'import yaml' 2> /dev/null; then
        python3 -c 'import yaml; yaml.safe_load(open("compose.yaml"))["services"]["meniscus"]' && say "compose file" "parsed" || failed=1
    else
        say "compose file" "not parsed: no YAML reader here"
    fi
fi
for script in ./*.sh; do bash -n "$script" || failed=1; done
say "scripts" "parsed"
exit $failed
