#!/bin/bash
# The spiraling vortex of the PCP paper (section 4.2) as a job: submitted with curl, watched, fetched.
# Usage: deploy/demo.sh PATH-TO-MENISCUS [OUTPUT-DIRECTORY]
set -euo pipefail

program=$(realpath "$1")
out=$(realpath -m "${2:-demo-output}")
# Only what an earlier demo has left is deleted.
if [ -d "$out" ] && [ -n "$(ls -A "$out")" ] && [ ! -f "$out/service.log" ]; then
    echo "$out has files that no demo has left: give another directory" >&2
    exit 1
fi
rm -rf "$out"
mkdir -p "$out"
data=$(mktemp -d)
service=
trap '[ -z "$service" ] || { kill "$service" && wait "$service"; } 2> /dev/null; rm -rf "$data"' EXIT

# Both cores for the one job. Port 0 picks a free port; the first line on standard output says which.
mkfifo "$data/announcement"
"$program" serve --data "$data/store" --bind 127.0.0.1:0 --slots 1 --threads "$(nproc)" \
    > "$data/announcement" 2> "$out/service.log" &
service=$!
read -r announcement < "$data/announcement"
url=${announcement#listening on }
echo "service at $url: open it in a browser and watch"
until curl -sf "$url/readyz" > /dev/null; do sleep 0.05; done

# Submits one scene, watches it to its end and fetches everything into a directory of its own.
run() {
    local name=$1 scene=$2
    local body="{\"name\": \"single vortex, $name\", \"scene\": $scene, \"output\": {\"every_time\": 4}}"
    echo "curl -X POST $url/v1/jobs -d '$body'"
    local job status state fraction eta filled bar
    job=$(curl -sf -X POST "$url/v1/jobs" -H 'content-type: application/json' -d "$body" | jq -r .id)
    echo "$url/#/jobs/$job"
    while :; do
        status=$(curl -sf "$url/v1/jobs/$job")
        read -r state fraction eta < <(jq -r '[.state, .progress.fraction, (.progress.eta_s // "?")] | @tsv' <<< "$status")
        filled=$(awk -v f="$fraction" 'BEGIN { printf "%d", 40 * f }')
        bar=$(printf '%*s' "$filled" '' | tr ' ' '#')
        [ "$eta" = "?" ] || eta=$(awk -v e="$eta" 'BEGIN { printf "%.0f s", e }')
        printf '\r[%-40s] %3.0f %%  %-10s ETA %-8s' \
            "$bar" "$(awk -v f="$fraction" 'BEGIN { print 100 * f }')" "$state" "$eta"
        case $state in
            succeeded) echo && break ;;
            failed | canceled | paused) echo && jq '{state, reason, hint, message}' <<< "$status" && exit 1 ;;
        esac
        sleep 0.3
    done
    # Everything at once, and the proof that it arrived whole.
    mkdir -p "$out/$name"
    curl -sf "$url/v1/jobs/$job/files.tar" | tar -x -C "$out/$name" --strip-components 1
    (cd "$out/$name" && sha256sum --quiet -c SHA256SUMS)
}

run best '{"kind": "vortex", "spacing": 0.015625}'
run paper '{"kind": "vortex", "preset": "paper", "spacing": 0.015625}'

value() {
    jq -r --arg q "$2" --arg n "$3" --argjson t "$4" \
        '.errors[] | select(.quantity == $q and .norm == $n and ((.time - $t) | fabs) < 1e-6) | .value' "$out/$1/report.json"
}
seconds() {
    jq -r --arg p "$2" '[.cost.phases | to_entries[] | select(.key | startswith($p)) | .value] | add' "$out/$1/report.json"
}
row() {
    printf '%-34s %12.3e %18.3e %16s\n' "$1" "$(value best $2)" "$(value paper $2)" "$3"
}
printf '\n%-34s %12s %18s %16s\n' "single vortex, h = 1/64" "best method" "paper's method" "paper, table 2"
row "RMS of the distance, t = 8" "phi rms 8" "1.42e-02"
row "maximum of the distance, t = 8" "phi max 8" "2.4e-02"
row "relative area, t = 8" "area relative 8" "3.83e-02"
row "RMS of the distance, t = 4" "phi rms 4" "-"
printf '%-34s %10.3f s %16.3f s\n' "CPU time of redistancing" "$(seconds best redistancing)" "$(seconds paper redistancing)"
printf '%-34s %10.3f s %16.3f s\n' "CPU time, references included" \
    "$(jq -r .cost.cpu_s "$out/best/report.json")" "$(jq -r .cost.cpu_s "$out/paper/report.json")"
jq -r '"\nbest method: \(.method.method)"' "$out/best/report.json"
echo
echo "in $out/best and $out/paper:"
echo "frames    frames.vtkhdf.series (open it in ParaView)"
echo "picture   picture.svg (particles by distance, zero level, t = 0, 4, 8)"
echo "report    report.json"
echo "series    series.csv"
echo
if [ -t 0 ] && [ "${DEMO_KEEP:-1}" != 0 ]; then
    echo "the page is at $url/; Ctrl-C ends the service"
    trap exit INT
    wait "$service"
else
    echo "the page was at $url/; with a terminal, and without DEMO_KEEP=0, the service goes on"
fi
