#!/bin/bash
# The spiraling vortex of the PCP paper (section 4.2) as a job: submitted with curl, watched, fetched.
# Usage: deploy/demo.sh PATH-TO-MENISCUS [OUTPUT-DIRECTORY]
set -euo pipefail

program=$(realpath "$1")
out=$(realpath -m "${2:-demo-output}")
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
echo "service at $url"
until curl -sf "$url/readyz" > /dev/null; do sleep 0.05; done

body='{
  "name": "spiraling vortex, h = 1/64",
  "scene": {"kind": "vortex", "preset": "paper", "spacing": 0.015625},
  "output": {"every_time": 4}
}'
echo "curl -X POST $url/v1/jobs -d '$body'"
job=$(curl -sf -X POST "$url/v1/jobs" -H 'content-type: application/json' -d "$body" | jq -r .id)
echo "job $job"

while :; do
    status=$(curl -sf "$url/v1/jobs/$job")
    read -r state fraction eta < <(jq -r '[.state, .progress.fraction, (.progress.eta_s // "?")] | @tsv' <<< "$status")
    filled=$(awk -v f="$fraction" 'BEGIN { printf "%d", 40 * f }')
    bar=$(printf '%*s' "$filled" '' | tr ' ' '#')
    [ "$eta" = "?" ] || eta=$(awk -v e="$eta" 'BEGIN { printf "%.0f s", e }')
    printf '\r[%-40s] %3.0f %%  %-10s ETA %-8s' "$bar" "$(awk -v f="$fraction" 'BEGIN { print 100 * f }')" "$state" "$eta"
    case $state in
        succeeded) echo && break ;;
        failed | canceled | paused) echo && jq '{state, reason, hint, message}' <<< "$status" && exit 1 ;;
    esac
    sleep 0.3
done

# Everything at once, and the proof that it arrived whole.
curl -sf "$url/v1/jobs/$job/files.tar" | tar -x -C "$out" --strip-components 1
(cd "$out" && sha256sum --quiet -c SHA256SUMS)

value() {
    jq -r --arg q "$1" --arg n "$2" --argjson t "$3" \
        '.errors[] | select(.quantity == $q and .norm == $n and ((.time - $t) | fabs) < 1e-6) | .value' "$out/report.json"
}
printf '\n%-32s %12s %12s\n' "h = 1/64" "here" "paper, table 2"
printf '%-32s %12.3e %12s\n' "RMS of the distance, t = 8" "$(value phi rms 8)" "1.42e-02"
printf '%-32s %12.3e %12s\n' "maximum of the distance, t = 8" "$(value phi max 8)" "2.4e-02"
printf '%-32s %12.3e %12s\n' "relative area, t = 8" "$(value area relative 8)" "3.83e-02"
printf '%-32s %12.3e %12s\n' "RMS of the distance, t = 4" "$(value phi rms 4)" "-"
jq -r '"\nwall \(.cost.wall_s * 100 | round / 100) s, CPU \(.cost.cpu_s * 100 | round / 100) s, \(.cost.steps) steps"' "$out/report.json"
echo
echo "frames    $out/frames.vtkhdf.series (open it in ParaView)"
echo "picture   $out/picture.svg (particles by distance, zero level, t = 0, 4, 8)"
echo "report    $out/report.json"
echo "series    $out/series.csv"
